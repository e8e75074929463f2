/** Follows a stream of news. `lost` is called where it breaks; it connects again by itself. @return what ends it */
export function follow<News>(url: string, heard: (news: News) => void, lost: () => void): () => void {
  let events: EventSource;
  let ended = false;
  const open = () => {
    if (ended) return;
    events = new EventSource(url);
    events.onmessage = (event) => heard(JSON.parse(event.data as string) as News);
    events.onerror = () => {
      lost();
      // Where it was refused the browser gives up.
      if (events.readyState === EventSource.CLOSED) setTimeout(open, 2000);
    };
  };
  open();
  return () => {
    ended = true;
    events.close();
  };
}

// Browsers let a page that was opened as a file load neither modules nor data. Say so, and what to do.
(function () {
  if (location.protocol !== "file:") return;
  var folder = decodeURIComponent(location.pathname.replace(/\/[^/]*$/, ""));
  var box = document.getElementById("message");
  box.hidden = false;
  box.innerHTML =
    '<div class="card"><h1>This volume needs a web server</h1>' +
    "<p>The page was opened as a file, and browsers do not let files load the data beside them. Either of these shows it:</p>" +
    "<pre></pre><p>The folder also works as it is on any static web host.</p></div>";
  box.querySelector("pre").textContent = "cnerf view " + folder + "\npython3 -m http.server --directory " + folder;
})();

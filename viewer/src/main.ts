/** Starts the page: a volume where there is a bundle, the studio or the running command where there is one. */

import { App } from "./app";
import { BundleError, parseBundle, type Bundle } from "./bundle";
import { pictureRectangle } from "./camera";
import { Input } from "./input";
import { Levels, textureBudget, thisDevice } from "./levels";
import { showLive } from "./live";
import { GraphicsError, Renderer } from "./renderer";
import { showStudio } from "./studio/studio";
import { copyText, download, el, iconButton, markCurrent, slider, slidesAcross, toast } from "./ui/dom";
import { Overlay } from "./ui/overlay";
import { Panel, resets } from "./ui/panel";

const root = document.getElementById("app")!;
const base = new URL("./", location.href).href.split(/[?#]/)[0];

function showMessage(title: string, text: string, ...more: Node[]): void {
  const box = document.getElementById("message")!;
  box.replaceChildren(el("div", { class: "card", role: "alert" }, el("h1", {}, title), el("p", {}, text), ...more));
  box.hidden = false;
  document.body.classList.remove("loading");
}

const retry = () => el("button", { class: "button", type: "button", onclick: () => location.reload() }, "Try again");

async function start(): Promise<void> {
  let answer: Response;
  try {
    answer = await fetch("./bundle.json", { cache: "no-cache" });
  } catch {
    return showMessage("The server does not answer", "It may have been ended. Start it again with cnerf view and reload this page.", retry());
  }
  if (answer.status === 404) {
    const studio = await fetch("./studio/state").catch(() => null);
    if (studio?.ok) return showStudio(root, await studio.json());
    const live = await fetch("./live/state").catch(() => null);
    if (live?.ok) return showLive(root, await live.json());
    return showMessage("Nothing to show", "There is no bundle.json beside this page. Write a bundle with cnerf bake --format web.");
  }
  if (!answer.ok) return showMessage("The volume cannot be loaded", `bundle.json: the server says ${answer.status} ${answer.statusText}.`, retry());
  await showVolume(parseBundle(await answer.text()));
}

function helpCard(close: () => void): HTMLElement {
  const rows: [string, string][] = [
    ["Drag", "turn about the subject (in fly mode: look around)"],
    ["Right drag, Shift + drag, two fingers", "move sideways"],
    ["Wheel, pinch", "nearer, farther; with Alt: focal length"],
    ["W A S D, arrows, Q E", "fly; down, up"],
    ["R", "back to the start"],
    ["F", "frame the whole volume, or the clip box"],
    ["[  ]", "previous, next camera of the capture"],
    ["G", "without colour, and back"],
    ["C", "clip box"],
    ["X", "slice"],
    ["K", "add a key frame; Space plays them"],
    ["P", "save a picture"],
    ["M", "settings"],
    ["?", "this help"],
  ];
  return el(
    "div", { class: "card help", role: "dialog", "aria-label": "Keys" },
    el("h1", {}, "Keys and gestures"),
    el("dl", {}, ...rows.flatMap(([key, what]) => [el("dt", {}, key), el("dd", {}, what)])),
    el("p", { class: "note" }, "A double click on a slider resets it. The address holds the view and the settings: share it."),
    el("button", { class: "button", type: "button", onclick: close }, "Close"),
  );
}

async function showVolume(bundle: Bundle): Promise<void> {
  document.title = bundle.title ? `${bundle.title} · cnerf` : "cnerf";
  const canvas = el("canvas", { id: "view", tabindex: "0", "aria-label": `Volume ${bundle.title}` });
  const poster = el("img", { class: "poster", alt: "" });
  const photo = el("img", { class: "photo", alt: "The photograph of this camera", hidden: true });
  const bar = el("div", { class: "bar" });
  const loading = el("div", { class: "loading-bar" }, bar);
  const stage = el("div", { class: "stage" }, poster, canvas, photo);
  root.append(stage, loading);
  document.body.classList.add("loading");
  if (bundle.poster) poster.src = bundle.poster;

  const renderer = new Renderer(canvas);
  const levels = new Levels(base, bundle, renderer, textureBudget(thisDevice()));
  await levels.first((share) => (bar.style.width = `${100 * share}%`));
  const app = new App(bundle, renderer);
  const panel = buildInterface(app, levels, stage, canvas, photo, poster);
  loading.remove();
  if (bundle.sky) void showSky(bundle.sky, renderer);
  await levels.rest(() => panel.showNote(levels.note));
  document.body.dataset.complete = "yes";
}

/** Without it, the background is as dark as ever. */
async function showSky(file: string, renderer: Renderer): Promise<void> {
  const image = new Image();
  image.src = file;
  try {
    await image.decode();
    renderer.setSky(image);
  } catch {
    toast(`${file} cannot be loaded`);
  }
}

function buildInterface(app: App, levels: Levels, stage: HTMLElement, canvas: HTMLCanvasElement, photo: HTMLImageElement, poster: HTMLImageElement): Panel {
  const { bundle, renderer } = app;
  const panel = new Panel(app);
  const overlay = new Overlay(app);

  const wipe = el("div", { class: "wipe", id: "wipe-handle", role: "slider", "aria-label": "Luminance and colour", "aria-valuemin": "0", "aria-valuemax": "100", tabindex: "0" },
    el("span", { class: "side left" }, "luminance"), el("span", { class: "grip" }), el("span", { class: "side right" }, "colour"));
  slidesAcross(wipe, () => stage, () => app.settings.wipe, (share) => app.set({ wipe: Math.min(1, Math.max(0, share)) }), () => stopReveal());

  const fade = slider({ id: "photo", label: "Photograph", title: resets, min: 0, max: 1, step: 0.01, value: 0, reset: 0, show: (v) => `${Math.round(100 * v)} %`, change: (v) => app.set({ photo: v }) });
  const cameraName = el("span", { class: "camera-name", id: "camera-name" });
  const current = () => Math.max(app.captureCamera, -1);
  const cameraBar = el("div", { class: "camera-bar" },
    el("button", { type: "button", class: "step", title: "Previous camera  [", "aria-label": "Previous camera", onclick: () => app.goToCamera(current() - 1) }, "‹"),
    cameraName,
    el("button", { type: "button", class: "step", title: "Next camera  ]", "aria-label": "Next camera", onclick: () => app.goToCamera(current() + 1) }, "›"),
    fade.node);
  const thumbnails = bundle.cameras.map((camera, i) =>
    el("button", { type: "button", class: "thumbnail", title: camera.name, "data-camera": i, onclick: () => app.goToCamera(i) },
      camera.photo ? el("img", { src: camera.photo, alt: camera.name, loading: "lazy" }) : el("span", {}, String(i + 1))));
  const strip = el("nav", { class: "strip", "aria-label": "Cameras of the capture" }, ...thumbnails);
  const foot = el("footer", { class: "foot", hidden: bundle.cameras.length === 0 }, cameraBar, strip);

  const help = el("div", { class: "veil", hidden: true });
  const toggleHelp = () => (help.hidden = !help.hidden);
  help.append(helpCard(toggleHelp));
  help.addEventListener("click", (e) => e.target === help && toggleHelp());

  const togglePanel = () => document.body.classList.toggle("panel-open");
  const screenshot = async () => {
    const image = await renderer.picture(canvas.width, canvas.height, app.settings.background);
    const target = el("canvas", { width: image.width, height: image.height });
    target.getContext("2d")!.putImageData(image, 0, 0);
    target.toBlob((blob) => blob && download(`${bundle.title || "volume"}.png`, blob), "image/png");
    toast("Picture saved");
  };
  const share = () => {
    history.replaceState(null, "", app.hash);
    return copyText(location.href, "Address copied", "Address:");
  };
  const head = el("header", { class: "head" },
    el("div", { class: "title" },
      el("img", { src: "./icon.svg", alt: "", width: 28, height: 28 }),
      el("div", {}, el("h1", {}, bundle.title || "cnerf"),
        el("p", {}, bundle.inferred ? `inferred colour · take ${bundle.take || "–"}` : "grey"))),
    el("div", { class: "tools" },
      iconButton("home", "Back to the start  R", () => app.reset(), "reset"),
      iconButton("frame", "Frame everything  F", () => app.frame(), "frame"),
      iconButton("camera", "Save a picture  P", () => void screenshot(), "screenshot"),
      iconButton("link", "Copy the address of this view", () => void share(), "share"),
      iconButton("help", "Keys  ?", toggleHelp, "help"),
      iconButton("panel", "Settings  M", togglePanel, "settings")));

  stage.append(overlay.svg, wipe);
  root.append(head, panel.node, foot, help);
  if (innerWidth > 900) document.body.classList.add("panel-open");

  const actions: Record<string, () => void> = {
    r: () => app.reset(), f: () => app.frame(), p: () => void screenshot(), "?": toggleHelp, h: toggleHelp, m: togglePanel,
    Escape: () => (help.hidden = true),
    "[": () => app.goToCamera(current() - 1), "]": () => app.goToCamera(current() + 1),
    g: () => app.set({ wipe: app.settings.wipe < 0.5 ? 1 : 0 }),
    c: () => document.getElementById("clip")!.click(), x: () => document.getElementById("slice")!.click(),
    k: () => panel.addKey(), " ": () => panel.play(),
  };
  const input = new Input(app, canvas, actions);

  const layout = () => {
    const ratio = Math.min(devicePixelRatio || 1, 2);
    renderer.setSize(stage.clientWidth * ratio, stage.clientHeight * ratio);
    dirty = true;
  };
  let dirty = true;
  new ResizeObserver(layout).observe(stage);
  app.onChange(() => (dirty = true));

  const update = () => {
    const { settings } = app;
    overlay.update();
    wipe.style.left = `${100 * settings.wipe}%`;
    wipe.setAttribute("aria-valuenow", String(Math.round(100 * settings.wipe)));
    wipe.classList.toggle("parked", settings.wipe < 0.004 || settings.wipe > 0.996);
    wipe.hidden = !bundle.inferred || !!settings.slice;
    stage.classList.toggle("checker", settings.background === "none");
    stage.style.background = settings.background.startsWith("#") ? settings.background : "";
    const camera = bundle.cameras[app.captureCamera];
    cameraName.textContent = camera ? camera.name.replace(/^.*\//, "") : "free view";
    fade.set(settings.photo);
    fade.node.inert = !camera?.photo;
    const shown = !!camera?.photo && settings.photo > 0;
    photo.hidden = !shown;
    if (shown) {
      if (!photo.src.endsWith(camera.photo!)) photo.src = camera.photo!;
      const box = pictureRectangle(app.view.lens, stage.clientWidth, stage.clientHeight);
      Object.assign(photo.style, { left: `${box.left}px`, top: `${box.top}px`, width: `${box.width}px`, height: `${box.height}px`, opacity: settings.photo });
    }
    markCurrent(strip, thumbnails, app.captureCamera);
  };

  let revealing = !new URLSearchParams(location.search).has("still") && bundle.inferred && app.settings.wipe === 0 && !matchMedia("(prefers-reduced-motion: reduce)").matches;
  const stopReveal = () => (revealing = false);
  canvas.addEventListener("pointerdown", () => revealing && (stopReveal(), app.set({ wipe: 0 })), { capture: true });
  let first = 0;
  let statisticsAt = 0;
  const loop = (now: number) => {
    requestAnimationFrame(loop);
    input.step(now);
    app.animate(now);
    const drew = renderer.frame(now);
    if (drew && !first) {
      first = now;
      document.body.classList.remove("loading");
      document.body.dataset.ready = "yes";
      poster.classList.add("gone");
    }
    if (revealing && first) {
      // From grey to colour, once: what the program does.
      const t = Math.min(1, Math.max(0, (now - first - 500) / 1500));
      app.set({ wipe: t >= 1 ? 0 : 1 - (t < 0.5 ? 2 * t * t : 1 - 2 * (1 - t) ** 2) });
      if (t >= 1) stopReveal();
    }
    if (dirty) {
      dirty = false;
      update();
    }
    if (now - statisticsAt > 500) {
      statisticsAt = now;
      const s = renderer.statistics();
      panel.showStatistics([
        ["frame", `${s.milliseconds.toFixed(0)} ms, ${s.framesASecond.toFixed(0)} a second while moving`],
        ["resolution", `${Math.round(100 * s.resolution)} % while moving, refined ${s.refined} of ${s.passes}`],
        ["picture", `${canvas.width} × ${canvas.height}`],
        ...levels.rows,
        ["textures", `${(s.textureBytes / 2 ** 20).toFixed(0)} MiB`],
        ["graphics", s.renderer],
      ]);
    }
  };
  layout();
  requestAnimationFrame(loop);

  canvas.addEventListener("webglcontextlost", (e) => {
    e.preventDefault();
    showMessage("The graphics card was taken away", "The browser or the driver ended the page's use of it, often for want of memory. Reloading usually brings it back.", retry());
  });
  // For scripts and tests.
  Object.assign(window, { cnerf: { app, renderer, panel, levels, stopReveal, settled: () => new Promise<void>((done) => {
    const poll = () => (renderer.settled ? done() : setTimeout(poll, 30));
    setTimeout(poll, 60);
  }) } });
  return panel;
}

if (location.protocol !== "file:") {
  start().catch((problem: unknown) => {
    if (problem instanceof BundleError) showMessage("The volume cannot be loaded", problem.message, retry());
    else if (problem instanceof GraphicsError) showMessage("This browser cannot show the volume", problem.message);
    else {
      showMessage("Something went wrong", String(problem), retry());
      throw problem;
    }
  });
}

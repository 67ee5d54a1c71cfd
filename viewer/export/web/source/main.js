// Starts the page. What goes wrong is told in one line.
import * as THREE from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { readJson, PageError } from "./folder.js";
import { Decoder } from "./decoder.js";
import { Identity } from "./identity.js";
import { Materials, cullSingleSided } from "./materials.js";
import { Panel, showError } from "./panel.js";
import { Stage } from "./stage.js";
import { Surfaces } from "./surfaces.js";
import { View } from "./view.js";

const FORMAT = 1;
// S. van der Walt and N. Smith, CC0: the viewer's own (viewer/state/palettes.py).
const VIRIDIS = [
  [0.267, 0.0049, 0.3294], [0.2759, 0.1669, 0.4689], [0.2298, 0.3224, 0.5457], [0.1727, 0.4488, 0.5579], [0.1276, 0.5669, 0.5506],
  [0.1579, 0.6838, 0.5017], [0.3692, 0.7889, 0.3829], [0.6783, 0.8637, 0.1895], [0.9932, 0.9062, 0.1439],
];

function fail(error) {
  if (!(error instanceof PageError)) console.error(error);
  showError(error instanceof PageError ? error.message : `Something went wrong: ${error.message}`);
}

function context(canvas) {
  const options = { alpha: true, antialias: false, premultipliedAlpha: true, powerPreference: "high-performance", preserveDrawingBuffer: false };
  const gl = canvas.getContext("webgl2", options);
  if (!gl) throw new PageError("This browser has no WebGL 2; use a newer one, or allow graphics acceleration in its settings");
  return gl;
}

async function start() {
  if (location.protocol === "file:") {
    throw new PageError("Browsers do not let a page on disk read its files: run python3 -m http.server in this folder and open http://localhost:8000");
  }
  const reading = readJson("page.json"); // while the graphics device is being opened
  reading.catch(() => {});
  const canvas = document.getElementById("canvas");
  const gl = context(canvas);
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    showError("The graphics device was lost; the page begins anew once it is back");
  });
  canvas.addEventListener("webglcontextrestored", () => location.reload());
  const page = await reading;
  if (page.format !== FORMAT) throw new PageError(`page.json: format ${page.format} is not ${FORMAT}; export the page again`);
  const renderer = new THREE.WebGLRenderer({ canvas, context: gl });
  renderer.debug.checkShaderErrors = true;
  renderer.debug.onShaderError = (own, program, vertex, fragment) => {
    const log = own.getShaderInfoLog(fragment) || own.getShaderInfoLog(vertex) || own.getProgramInfoLog(program) || "unknown";
    fail(new PageError(`A shader does not compile on this device: ${log.split("\n")[0]}`));
  };
  cullSingleSided(renderer);
  const decoder = new Decoder(renderer, page);
  const isSmall = matchMedia("(pointer: coarse)").matches || (navigator.deviceMemory ?? 8) <= 4;
  let view = null;
  const surfaces = new Surfaces(renderer, page, decoder, isSmall ? 48e6 : 160e6, () => view?.refreshed(), fail);
  const materials = new Materials(page, surfaces);
  const stage = new Stage(renderer, canvas, page, () => view?.moved());
  const identity = new Identity(renderer, decoder.screen, VIRIDIS);
  await Promise.all([decoder.prepare(), stage.load(materials)]);
  view = new View(renderer, stage, materials, surfaces, identity);
  const fit = () => {
    const [width, height] = [window.innerWidth, window.innerHeight];
    view.ratio = Math.min(window.devicePixelRatio, 2);
    renderer.setSize(width, height, false);
    stage.resize(width, height);
    view.moved();
  };
  window.addEventListener("resize", fit);
  fit();
  document.documentElement.dataset.ready = performance.now().toFixed(0);
  const panel = new Panel(page, view, stage, surfaces, decoder, VIRIDIS);
  panel.refresh();
  decoder.paced = () => view.tell();
  watch(view);
  window.ntcPage = { page, renderer, decoder, surfaces, stage, view, panel, GLTFLoader };
}

/** Says in the document when the first picture is there, and when all of it is. */
function watch(view) {
  let [first, whole] = [false, false];
  const { dataset } = document.documentElement;
  view.listeners.push(() => {
    if (!first && view.looked >= 0 && view.shown > 0) {
      first = true;
      dataset.first = performance.now().toFixed(0);
    }
    if (first && !whole && view.isComplete) {
      whole = true;
      dataset.whole = performance.now().toFixed(0);
    }
    dataset.state = view.isComplete ? "complete" : "working";
  });
}

start().catch(fail);

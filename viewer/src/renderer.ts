/**
 * Draws a volume with WebGL 2. While something changes, a frame is marched at the resolution that the last frames'
 * times allow; at rest it is refined at full resolution, in strips short enough to keep the page responsive, and
 * averaged over rays spread within each pixel.
 */

import type { AtlasPlan, SlabTexels } from "./bricks";
import { brickTexels } from "./bricks";
import type { Bundle } from "./bundle";
import { fitted, type View } from "./camera";
import { linearOfHex } from "./color";
import { clamp, column, scale, sub, type Vec3 } from "./math";
import { defaultBackground, quantities, type Settings } from "./settings";
import * as shaders from "./shaders";

/** This browser cannot show the volume; the message says why and what to do. */
export class GraphicsError extends Error {}

const stepMoving = 1;
const stepRefined = 0.5;
const passes = 16;
const stripMilliseconds = 24;
const frameMilliseconds = 30;

interface Target {
  texture: WebGLTexture;
  framebuffer: WebGLFramebuffer;
  width: number;
  height: number;
}

class Program {
  private readonly program: WebGLProgram;
  private readonly locations = new Map<string, WebGLUniformLocation | null>();

  constructor(private readonly gl: WebGL2RenderingContext, fragment: string) {
    this.program = gl.createProgram()!;
    for (const [kind, source] of [[gl.VERTEX_SHADER, shaders.fullScreen], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(kind)!;
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new GraphicsError(`This graphics driver cannot compile the page's shaders: ${gl.getShaderInfoLog(shader)}`);
      }
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new GraphicsError(`This graphics driver cannot link the page's shaders: ${gl.getProgramInfoLog(this.program)}`);
    }
  }
  use(): void {
    this.gl.useProgram(this.program);
  }
  at(name: string): WebGLUniformLocation | null {
    if (!this.locations.has(name)) this.locations.set(name, this.gl.getUniformLocation(this.program, name));
    return this.locations.get(name)!;
  }
}

export interface Statistics {
  /** Pixels marched while moving, share of the canvas's. */
  resolution: number;
  /** Of the last moving frame. */
  milliseconds: number;
  framesASecond: number;
  /** Refinement passes done, of how many. */
  refined: number;
  passes: number;
  textureBytes: number;
  renderer: string;
}

/** Well spread points of the unit square (Roberts' R2 sequence). */
function spread(i: number): [number, number] {
  return [(0.5 + i * 0.7548776662466927) % 1, (0.5 + i * 0.5698402909980532) % 1];
}

export class Renderer {
  readonly gl: WebGL2RenderingContext;
  private march: Program;
  private copy: Program;
  private display: Program;
  private index!: WebGLTexture;
  private density!: WebGLTexture;
  private lab!: WebGLTexture;
  private sky: WebGLTexture | null = null;
  private atlas: AtlasPlan | null = null;
  private bundle: Bundle | null = null;
  /** Levels that are there, coarsest first. */
  private levels = 0;
  private moving: Target | null = null;
  private fine: Target | null = null;
  private floatTargets: boolean;

  private view: View | null = null;
  private settings: Settings | null = null;
  private needsMarch = true;
  private needsDisplay = true;
  private lastChange = 0;
  private resolution = 0.5;
  private fence: { sync: WebGLSync; begin: number; pixels: number; kind: "moving" | "strip" } | null = null;
  private nanosecondsAPixel = 200;
  private pass = 0;
  private row = 0;
  private refining = false;
  private shown: Target | null = null;
  private frameTimes: number[] = [];
  private lastMilliseconds = 0;

  /** @throws GraphicsError where WebGL 2 is missing. */
  constructor(readonly canvas: HTMLCanvasElement) {
    const gl = canvas.getContext("webgl2", { alpha: true, antialias: false, depth: false, premultipliedAlpha: false, preserveDrawingBuffer: true, powerPreference: "high-performance" });
    if (!gl) {
      throw new GraphicsError(
        "This browser does not offer WebGL 2, which the viewer draws with. Use a current Firefox, Chrome, Edge or Safari, " +
          "and see that hardware acceleration is switched on in its settings.",
      );
    }
    this.gl = gl;
    this.floatTargets = !!gl.getExtension("EXT_color_buffer_float") || !!gl.getExtension("EXT_color_buffer_half_float");
    this.march = new Program(gl, shaders.march);
    this.copy = new Program(gl, shaders.copy);
    this.display = new Program(gl, shaders.display);
    gl.bindVertexArray(gl.createVertexArray());
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.DITHER);
  }

  get maxTexture(): number {
    return this.gl.getParameter(this.gl.MAX_3D_TEXTURE_SIZE) as number;
  }

  /** Makes room for the levels of a bundle. @throws GraphicsError when the graphics card's memory does not hold them. */
  allocate(bundle: Bundle, atlas: AtlasPlan): void {
    const { gl } = this;
    for (const texture of [this.index, this.density, this.lab]) if (texture) gl.deleteTexture(texture);
    this.bundle = bundle;
    this.levels = 0;
    const [ax, ay, az] = atlas.counts.map((n) => n * brickTexels);
    while (gl.getError() !== gl.NO_ERROR);
    this.index = this.texture3d(gl.NEAREST);
    gl.texStorage3D(gl.TEXTURE_3D, 1, gl.RGBA8UI, ...atlas.index);
    this.density = this.texture3d(gl.LINEAR);
    gl.texStorage3D(gl.TEXTURE_3D, 1, gl.R16F, ax, ay, az);
    this.lab = this.texture3d(gl.LINEAR);
    gl.texStorage3D(gl.TEXTURE_3D, 1, gl.RGBA8, ax, ay, az);
    this.atlas = atlas;
    this.checkMemory();
  }
  /** @param slab  of the atlas, counted from its beginning. @throws GraphicsError as allocate. */
  putSlab(slab: number, texels: SlabTexels): void {
    const { gl } = this;
    const [ax, ay] = this.atlas!.counts.map((n) => n * brickTexels);
    gl.activeTexture(gl.TEXTURE0);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.bindTexture(gl.TEXTURE_3D, this.density);
    gl.texSubImage3D(gl.TEXTURE_3D, 0, 0, 0, slab * brickTexels, ax, ay, brickTexels, gl.RED, gl.HALF_FLOAT, texels.density);
    gl.bindTexture(gl.TEXTURE_3D, this.lab);
    gl.texSubImage3D(gl.TEXTURE_3D, 0, 0, 0, slab * brickTexels, ax, ay, brickTexels, gl.RGBA, gl.UNSIGNED_BYTE, texels.lab);
  }
  /** What is behind the volume where the background is "sky". */
  setSky(image: TexImageSource): void {
    const { gl } = this;
    if (this.sky) gl.deleteTexture(this.sky);
    this.sky = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.sky);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
    for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_WRAP_S, gl.REPEAT], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) {
      gl.texParameteri(gl.TEXTURE_2D, name, value);
    }
    this.needsDisplay = true;
  }
  /** Shows the next finer level, whose slabs are there. @throws GraphicsError as allocate. */
  addLevel(index: Uint8Array): void {
    const { gl } = this;
    const [bx, by, bz] = this.bundle!.levels[this.levels].bricks;
    gl.activeTexture(gl.TEXTURE0);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.bindTexture(gl.TEXTURE_3D, this.index);
    gl.texSubImage3D(gl.TEXTURE_3D, 0, 0, 0, this.atlas!.levels[this.levels].base, bx, by, bz, gl.RGBA_INTEGER, gl.UNSIGNED_BYTE, index);
    this.checkMemory();
    this.levels += 1;
    this.invalidate();
  }
  private checkMemory(): void {
    if (this.gl.getError() === this.gl.NO_ERROR) return;
    throw new GraphicsError(
      `The graphics card cannot hold this volume (${Math.round(this.atlas!.bytes / 2 ** 20)} MiB of textures). ` +
        "Close other tabs, or write a smaller bundle: cnerf bake --format web --web-resolution 192",
    );
  }

  setSize(width: number, height: number): void {
    width = Math.max(1, Math.round(width));
    height = Math.max(1, Math.round(height));
    if (this.canvas.width === width && this.canvas.height === height) return;
    this.canvas.width = width;
    this.canvas.height = height;
    this.invalidate();
  }

  /** Something that rays see has changed. */
  invalidate(): void {
    this.needsMarch = true;
    this.refining = false;
    this.lastChange = performance.now();
  }
  setView(view: View): void {
    this.view = view;
    this.invalidate();
  }
  setSettings(settings: Settings, march: boolean): void {
    this.settings = settings;
    this.needsDisplay = true;
    if (march) this.invalidate();
  }

  /** Whether all refinement is done and shown. */
  get settled(): boolean {
    return !this.needsMarch && !this.needsDisplay && !this.fence && this.pass >= passes;
  }

  statistics(): Statistics {
    const { gl } = this;
    const info = gl.getExtension("WEBGL_debug_renderer_info");
    const times = this.frameTimes;
    const span = times.length > 1 ? times[times.length - 1] - times[0] : 0;
    return {
      resolution: this.resolution,
      milliseconds: this.lastMilliseconds,
      framesASecond: span > 0 ? (1000 * (times.length - 1)) / span : 0,
      refined: Math.min(this.pass, passes),
      passes,
      textureBytes: this.atlas?.bytes ?? 0,
      renderer: String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER)),
    };
  }

  /** To be called once an animation frame. @return whether anything was drawn. */
  frame(now: number): boolean {
    if (this.levels === 0 || !this.view || !this.settings || this.gl.isContextLost()) return false;
    if (this.fence && !this.finishFence()) return false;
    if (this.needsMarch) {
      this.marchMoving(now);
      return true;
    }
    if (this.pass < passes && (this.refining || now - this.lastChange > 140)) {
      this.refineStrip();
      return true;
    }
    if (this.needsDisplay) {
      this.show();
      return true;
    }
    return false;
  }

  private marchMoving(now: number): void {
    const width = Math.max(1, Math.round(this.canvas.width * this.resolution));
    const height = Math.max(1, Math.round(this.canvas.height * this.resolution));
    this.moving = this.target(this.moving, width, height);
    this.bindMarch(this.moving, stepMoving, [0.5, 0.5], 0.5, 1 / 128);
    this.gl.disable(this.gl.BLEND);
    this.draw();
    this.startFence(width * height, "moving");
    this.needsMarch = false;
    this.refining = false;
    this.pass = 0;
    this.row = 0;
    this.shown = this.moving;
    this.frameTimes.push(now);
    while (this.frameTimes.length > 2 && now - this.frameTimes[0] > 1500) this.frameTimes.shift();
    this.show();
  }

  private refineStrip(): void {
    const { gl } = this;
    const { width, height } = this.canvas;
    if (!this.refining) {
      this.fine = this.target(this.fine, width, height);
      if (this.shown) {
        // Strips replace the moving frame from the top.
        this.copy.use();
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.fine.framebuffer);
        gl.viewport(0, 0, width, height);
        gl.disable(gl.BLEND);
        this.bind2d(this.copy, this.shown);
        this.draw();
      }
      this.shown = this.fine;
      this.refining = true;
      this.pass = 0;
      this.row = 0;
    }
    const rows = clamp(Math.floor((stripMilliseconds * 1e6) / (this.nanosecondsAPixel * width)), 4, height - this.row);
    this.marchRows(this.fine!, this.pass, this.row, rows);
    this.startFence(rows * width, "strip");
    this.row += rows;
    if (this.row >= height) {
      this.row = 0;
      this.pass += this.floatTargets ? 1 : passes;
    }
    this.show();
  }

  private marchRows(target: Target, pass: number, row: number, rows: number): void {
    const { gl } = this;
    this.bindMarch(target, stepRefined, spread(pass), (pass * 0.618033988749895 + 0.5) % 1, 1 / 1024);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, target.height - row - rows, target.width, rows);
    if (pass === 0) {
      gl.disable(gl.BLEND);
    } else {
      gl.enable(gl.BLEND);
      gl.blendColor(0, 0, 0, 1 / (pass + 1));
      gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
    }
    this.draw();
    gl.disable(gl.BLEND);
    gl.disable(gl.SCISSOR_TEST);
  }

  private bindMarch(target: Target, step: number, offset: [number, number], noise: number, end: number): void {
    const { gl, march } = this;
    const { volume } = this.bundle!;
    const settings = this.settings!;
    const view = this.view!;
    const toVoxels = (p: Vec3) => scale(sub(p, volume.origin), 1 / volume.voxelSize);
    const lens = fitted(view.lens, target.width, target.height);
    const [x, y, z] = [column(view.rotation, 0), column(view.rotation, 1), column(view.rotation, 2)];
    const size = scale(volume.bricks, 8);
    const low = settings.clip ? (toVoxels(settings.clip.low).map((v) => Math.max(v, 0)) as Vec3) : ([0, 0, 0] as Vec3);
    const high = settings.clip ? (toVoxels(settings.clip.high).map((v, i) => Math.min(v, size[i])) as Vec3) : size;
    march.use();
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    gl.viewport(0, 0, target.width, target.height);
    for (const [unit, name, texture] of [[0, "u_index", this.index], [1, "u_density", this.density], [2, "u_lab", this.lab]] as const) {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_3D, texture);
      gl.uniform1i(march.at(name), unit);
    }
    this.bindLevels();
    gl.uniform3fv(march.at("u_texel"), this.atlas!.counts.map((n) => 1 / (n * brickTexels)));
    gl.uniform3fv(march.at("u_eye"), toVoxels(view.position));
    gl.uniformMatrix3fv(march.at("u_right_down_forward"), false, [...x, ...y, ...z]);
    gl.uniform4f(march.at("u_lens"), lens.fx, lens.fy, lens.cx, lens.cy);
    gl.uniform2f(march.at("u_offset"), offset[0], offset[1]);
    gl.uniform1f(march.at("u_height"), target.height);
    gl.uniform3fv(march.at("u_low"), low);
    gl.uniform3fv(march.at("u_high"), high);
    gl.uniform1f(march.at("u_step"), step);
    gl.uniform1f(march.at("u_gain"), settings.gain);
    gl.uniform1f(march.at("u_threshold"), settings.threshold);
    gl.uniform1f(march.at("u_end"), end);
    gl.uniform1f(march.at("u_noise"), noise);
    const { slice } = settings;
    gl.uniform1i(march.at("u_slice"), slice ? slice.axis : -1);
    gl.uniform1f(march.at("u_slice_at"), slice ? toVoxels([slice.at, slice.at, slice.at])[slice.axis] : 0);
    gl.uniform1i(march.at("u_quantity"), slice ? quantities.indexOf(slice.quantity) : 0);
    const densest = Math.max(...this.bundle!.levels.slice(0, this.levels).map(({ density }) => Math.min(density.max, density.scale)));
    gl.uniform1f(march.at("u_density_max"), Math.max(1e-6, densest * volume.voxelSize));
  }

  /** Where the levels lie, in voxels of the coarsest. */
  private bindLevels(): void {
    const { gl, march } = this;
    const { levels, volume } = this.bundle!;
    const there = levels.slice(0, this.levels);
    const toVoxels = (p: Vec3) => scale(sub(p, volume.origin), 1 / volume.voxelSize);
    gl.uniform1i(march.at("u_levels"), there.length);
    gl.uniform3fv(march.at("u_cover_low"), there.flatMap(({ cover }) => toVoxels(cover.low)));
    gl.uniform3fv(march.at("u_cover_high"), there.flatMap(({ cover }) => toVoxels(cover.high)));
    gl.uniform4fv(march.at("u_place"), there.flatMap(({ origin, voxelSize }) => [...scale(sub(volume.origin, origin), 1 / voxelSize), volume.voxelSize / voxelSize]));
    gl.uniform4iv(march.at("u_grid"), there.flatMap(({ bricks }, i) => [...bricks, this.atlas!.levels[i].base]));
  }

  private show(): void {
    if (!this.shown) return;
    this.needsDisplay = false;
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, null);
    this.displayTo(this.shown, this.canvas.width, this.canvas.height, this.settings!.background);
  }

  private displayTo(source: Target, width: number, height: number, background: string): void {
    const { gl, display } = this;
    const settings = this.settings!;
    gl.viewport(0, 0, width, height);
    gl.disable(gl.BLEND);
    display.use();
    this.bind2d(display, source);
    gl.uniform2f(display.at("u_size"), width, height);
    gl.uniform1f(display.at("u_wipe"), settings.wipe);
    gl.uniform1f(display.at("u_saturation"), settings.saturation);
    const hue = (settings.hue * Math.PI) / 180;
    gl.uniform2f(display.at("u_hue"), Math.cos(hue), Math.sin(hue));
    gl.uniform1f(display.at("u_exposure"), 2 ** settings.exposure);
    this.bindSky(width, height, background === "sky" && !settings.slice);
    if (background === "sky") background = defaultBackground;
    if (background === "none") gl.uniform4f(display.at("u_background"), 0, 0, 0, 0);
    else gl.uniform4f(display.at("u_background"), ...linearOfHex(background), 1);
    gl.uniform1i(display.at("u_plain"), settings.slice ? 1 : 0);
    this.draw();
  }

  /** @param wanted  as the background; what the bundle does not have is not shown. */
  private bindSky(width: number, height: number, wanted: boolean): void {
    const { gl, display } = this;
    gl.uniform1i(display.at("u_has_sky"), wanted && this.sky ? 1 : 0);
    gl.uniform1i(display.at("u_sky"), 1);
    if (!wanted || !this.sky) return;
    const view = this.view!;
    const lens = fitted(view.lens, width, height);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.sky);
    gl.uniformMatrix3fv(display.at("u_right_down_forward"), false, ([0, 1, 2] as const).flatMap((axis) => column(view.rotation, axis)));
    gl.uniform4f(display.at("u_lens"), lens.fx, lens.fy, lens.cx, lens.cy);
  }

  /**
   * A picture of the current view and settings, as the screen shows it, at any size.
   * @param background  "#rrggbb", "sky", or "none" for an alpha channel.
   * @param rays  a pixel.
   */
  async picture(width: number, height: number, background: string, rays = passes): Promise<ImageData> {
    const { gl } = this;
    const light = this.target(null, width, height);
    const rows = clamp(Math.floor((4 * stripMilliseconds * 1e6) / (this.nanosecondsAPixel * width)), 4, height);
    const { levels } = this;
    const view = structuredClone(this.view), settings = structuredClone(this.settings);
    // The page goes on meanwhile: each piece is of what was to be seen at the beginning.
    const asItWas = (draw: () => void) => {
      const now = { view: this.view, settings: this.settings, levels: this.levels };
      Object.assign(this, { view, settings, levels });
      draw();
      Object.assign(this, now);
    };
    for (let pass = 0; pass < (this.floatTargets ? rays : 1); ++pass) {
      for (let row = 0; row < height; row += rows) {
        asItWas(() => this.marchRows(light, pass, row, Math.min(rows, height - row)));
        await this.drained();
      }
    }
    const bytes = this.target(null, width, height, true);
    gl.bindFramebuffer(gl.FRAMEBUFFER, bytes.framebuffer);
    asItWas(() => this.displayTo(light, width, height, background));
    const flipped = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, flipped);
    for (const target of [light, bytes]) this.free(target);
    const result = new ImageData(width, height);
    for (let y = 0; y < height; ++y) result.data.set(flipped.subarray(4 * width * (height - 1 - y), 4 * width * (height - y)), 4 * width * y);
    this.needsDisplay = true;
    return result;
  }

  private drained(): Promise<void> {
    const { gl } = this;
    const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0)!;
    gl.flush();
    return new Promise((resolve) => {
      const poll = () => {
        if (gl.isContextLost() || gl.getSyncParameter(sync, gl.SYNC_STATUS) === gl.SIGNALED) {
          gl.deleteSync(sync);
          resolve();
        } else {
          setTimeout(poll, 2);
        }
      };
      poll();
    });
  }

  private startFence(pixels: number, kind: "moving" | "strip"): void {
    const sync = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0)!;
    this.gl.flush();
    this.fence = { sync, begin: performance.now(), pixels, kind };
  }

  private finishFence(): boolean {
    const { gl } = this;
    const { sync, begin, pixels, kind } = this.fence!;
    if (gl.getSyncParameter(sync, gl.SYNC_STATUS) !== gl.SIGNALED) return false;
    gl.deleteSync(sync);
    this.fence = null;
    const milliseconds = performance.now() - begin;
    if (kind === "strip") {
      const measured = (milliseconds * 1e6) / pixels;
      this.nanosecondsAPixel += 0.3 * (measured - this.nanosecondsAPixel);
      return true;
    }
    this.lastMilliseconds = milliseconds;
    // Pixels go with the square of the resolution; half-way corrections do not swing.
    const wanted = this.resolution * Math.sqrt(frameMilliseconds / Math.max(milliseconds, 1));
    this.resolution = clamp(0.5 * (this.resolution + wanted), 0.12, 1);
    return true;
  }

  private draw(): void {
    this.gl.drawArrays(this.gl.TRIANGLES, 0, 3);
  }

  private bind2d(program: Program, source: Target): void {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE3);
    gl.bindTexture(gl.TEXTURE_2D, source.texture);
    gl.uniform1i(program.at("u_image"), 3);
    gl.uniform2f(program.at("u_size"), this.canvas.width, this.canvas.height);
  }

  private texture3d(filter: number): WebGLTexture {
    const { gl } = this;
    const texture = gl.createTexture()!;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_3D, texture);
    gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MIN_FILTER, filter);
    gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MAG_FILTER, filter);
    for (const wrap of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R]) gl.texParameteri(gl.TEXTURE_3D, wrap, gl.CLAMP_TO_EDGE);
    return texture;
  }

  private target(old: Target | null, width: number, height: number, bytes = false): Target {
    if (old && old.width === width && old.height === height) return old;
    if (old) this.free(old);
    const { gl } = this;
    const texture = gl.createTexture()!;
    gl.activeTexture(gl.TEXTURE3);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, this.floatTargets && !bytes ? gl.RGBA16F : gl.RGBA8, width, height);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    const framebuffer = gl.createFramebuffer()!;
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    return { texture, framebuffer, width, height };
  }
  private free(target: Target): void {
    this.gl.deleteFramebuffer(target.framebuffer);
    this.gl.deleteTexture(target.texture);
  }
}

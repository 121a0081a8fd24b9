/** Points and a grid by WebGL 2. Everything it keeps on the graphics card can be lost at any time, and is made again. */

import type { Cloud } from "../../live/media/cloud";
import type { Matrix } from "./cloud_view";

export type Colouring = "height" | "distance" | "intensity";

const MODES: Record<Colouring, number> = { height: 0, distance: 1, intensity: 2 };
const GRID_M = 1;
const GRID_LINES = 10;
/** Of the axes over the ground, or its lines would hide them. */
const ABOVE_M = 0.03;

const POINT_VERTEX = `#version 300 es
in vec3 place;
in float strength;
uniform mat4 view;
uniform int mode;
uniform vec2 span;
uniform float size;
out float part;
void main() {
  gl_Position = view * vec4(place, 1.0);
  gl_PointSize = clamp(size / gl_Position.w, 1.5, 8.0);
  float value = mode == 0 ? place.z : mode == 1 ? length(place) : strength;
  part = clamp((value - span.x) / (span.y - span.x), 0.0, 1.0);
}`;
const POINT_FRAGMENT = `#version 300 es
precision mediump float;
in float part;
uniform vec3 stops[5];
out vec4 colour;
void main() {
  float at = part * 4.0;
  int below = int(min(at, 3.0));
  colour = vec4(mix(stops[below], stops[below + 1], at - float(below)), 1.0);
}`;
const LINE_VERTEX = `#version 300 es
in vec3 place;
in vec3 tint;
uniform mat4 view;
out vec3 shade;
void main() {
  gl_Position = view * vec4(place, 1.0);
  shade = tint;
}`;
const LINE_FRAGMENT = `#version 300 es
precision mediump float;
in vec3 shade;
out vec4 colour;
void main() { colour = vec4(shade, 1.0); }`;

/** From low to high, to be told apart on a light and on a dark ground. */
const STOPS = {
  light: ["#1f2f8f", "#0a6f9e", "#0b8a5f", "#b26a00", "#b3261e"],
  dark: ["#5b7cff", "#35c4e8", "#4be08a", "#ffd24d", "#ff7a66"],
};

/** Red, green and blue from 0 to 1, of #rrggbb or rgb(r, g, b). */
export function rgb(text: string): [number, number, number] {
  const hex = /^#([0-9a-f]{6})$/i.exec(text.trim());
  if (hex) return [0, 2, 4].map((at) => parseInt(hex[1]!.slice(at, at + 2), 16) / 255) as [number, number, number];
  const parts = text.match(/[\d.]+/g)?.map(Number) ?? [];
  return [0, 1, 2].map((at) => (parts[at] ?? 128) / 255) as [number, number, number];
}

export interface Scene {
  view: Matrix;
  colouring: Colouring;
  /** The page's colours: ground and grid. */
  ground: string;
  grid: string;
  density: number;
}

interface Kept {
  points: WebGLProgram;
  lines: WebGLProgram;
  cloud: WebGLVertexArrayObject;
  places: WebGLBuffer;
  strengths: WebGLBuffer;
  frame: WebGLVertexArrayObject;
  tints: WebGLBuffer;
  vertices: number;
}

export class CloudPainter {
  #gl: WebGL2RenderingContext;
  #kept: Kept | null = null;
  #cloud: Cloud | null = null;
  #uploaded = false;
  #tinted = "";

  /** null where the browser has no WebGL 2. */
  static on(canvas: HTMLCanvasElement): CloudPainter | null {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false, powerPreference: "low-power" });
    return gl && new CloudPainter(gl);
  }

  private constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
  }

  get lost(): boolean {
    return this.#gl.isContextLost();
  }

  /** The context came back: nothing is there any more. */
  restored(): void {
    this.#kept = null;
    this.#uploaded = false;
    this.#tinted = "";
  }

  show(cloud: Cloud | null): void {
    this.#cloud = cloud;
    this.#uploaded = false;
  }

  draw(scene: Scene): void {
    const gl = this.#gl;
    if (this.lost) return;
    const kept = (this.#kept ??= this.#make());
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.clearColor(...rgb(scene.ground), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    this.#drawLines(kept, scene);
    if (this.#cloud) this.#drawPoints(kept, scene, this.#cloud);
  }

  /** Let the graphics card's memory go. */
  close(): void {
    this.#gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  #drawLines(kept: Kept, scene: Scene): void {
    const gl = this.#gl;
    if (this.#tinted !== scene.grid) {
      gl.bindBuffer(gl.ARRAY_BUFFER, kept.tints);
      gl.bufferData(gl.ARRAY_BUFFER, tintsOf(rgb(scene.grid)), gl.STATIC_DRAW);
      this.#tinted = scene.grid;
    }
    gl.useProgram(kept.lines);
    gl.uniformMatrix4fv(gl.getUniformLocation(kept.lines, "view"), false, scene.view);
    gl.bindVertexArray(kept.frame);
    gl.drawArrays(gl.LINES, 0, kept.vertices);
  }

  #drawPoints(kept: Kept, scene: Scene, cloud: Cloud): void {
    const gl = this.#gl;
    if (!this.#uploaded) {
      gl.bindBuffer(gl.ARRAY_BUFFER, kept.places);
      gl.bufferData(gl.ARRAY_BUFFER, cloud.positions, gl.STREAM_DRAW);
      gl.bindBuffer(gl.ARRAY_BUFFER, kept.strengths);
      gl.bufferData(gl.ARRAY_BUFFER, cloud.intensities ?? new Float32Array(cloud.positions.length / 3), gl.STREAM_DRAW);
      this.#uploaded = true;
    }
    const { points } = kept;
    gl.useProgram(points);
    const at = (name: string) => gl.getUniformLocation(points, name);
    gl.uniformMatrix4fv(at("view"), false, scene.view);
    gl.uniform1i(at("mode"), MODES[scene.colouring]);
    gl.uniform2fv(at("span"), cloud[scene.colouring]);
    gl.uniform1f(at("size"), 45 * scene.density);
    gl.uniform3fv(at("stops"), STOPS[isDark(scene.ground) ? "dark" : "light"].flatMap(rgb));
    gl.bindVertexArray(kept.cloud);
    gl.drawArrays(gl.POINTS, 0, cloud.positions.length / 3);
  }

  #make(): Kept {
    const gl = this.#gl;
    const points = this.#program(POINT_VERTEX, POINT_FRAGMENT);
    const lines = this.#program(LINE_VERTEX, LINE_FRAGMENT);
    const [cloud, places, strengths] = [gl.createVertexArray()!, gl.createBuffer()!, gl.createBuffer()!];
    gl.bindVertexArray(cloud);
    this.#attribute(points, "place", places, 3);
    this.#attribute(points, "strength", strengths, 1);
    const [frame, grid, tints] = [gl.createVertexArray()!, gl.createBuffer()!, gl.createBuffer()!];
    gl.bindVertexArray(frame);
    this.#attribute(lines, "place", grid, 3);
    gl.bufferData(gl.ARRAY_BUFFER, GRID, gl.STATIC_DRAW);
    this.#attribute(lines, "tint", tints, 3);
    gl.bindVertexArray(null);
    return { points, lines, cloud, places, strengths, frame, tints, vertices: GRID.length / 3 };
  }

  #attribute(program: WebGLProgram, name: string, buffer: WebGLBuffer, size: number): void {
    const gl = this.#gl;
    const at = gl.getAttribLocation(program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, size, gl.FLOAT, false, 0, 0);
  }

  #program(vertex: string, fragment: string): WebGLProgram {
    const gl = this.#gl;
    const program = gl.createProgram()!;
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(kind)!;
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(program) ?? "WebGL");
    return program;
  }
}

const isDark = (ground: string) => rgb(ground).reduce((sum, part) => sum + part, 0) < 1.5;

/** The axes first (x, y, z, a metre each), then squares of a metre on the ground. */
const GRID = (() => {
  const lines = [[0, 0, ABOVE_M, 1, 0, ABOVE_M], [0, 0, ABOVE_M, 0, 1, ABOVE_M], [0, 0, ABOVE_M, 0, 0, 1]];
  const reach = GRID_LINES * GRID_M;
  for (let at = -reach; at <= reach; at += GRID_M) lines.push([at, -reach, 0, at, reach, 0], [-reach, at, 0, reach, at, 0]);
  return new Float32Array(lines.flat());
})();

/** Red, green and blue axes; the rest as the page's lines. */
function tintsOf(grid: [number, number, number]): Float32Array<ArrayBuffer> {
  const axes = [rgb("#d6453d"), rgb("#2f9e55"), rgb("#3b74e0")];
  const vertices = GRID.length / 3;
  return new Float32Array(Array.from({ length: vertices }, (_, vertex) => axes[vertex >> 1] ?? grid).flat());
}

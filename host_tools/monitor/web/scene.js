// The seafloor in WebGL: chunks of 128 x 128 cells, each a texture of its cells and a mesh that all share. A tile
// that changed goes into its chunk's texture (and the rims of the neighbours'), nothing else is touched; shape,
// light, colour, contours and gaps are the shaders' business.
import {
  ClampToEdgeWrapping, DataTexture, DoubleSide, BufferAttribute, BufferGeometry, FloatType, LinearFilter, Mesh,
  Box3, Frustum, Matrix4, NearestFilter, OrthographicCamera, PerspectiveCamera, RGBAFormat, RGBFormat, Scene, ShaderMaterial, Vector2, Vector3,
  WebGLRenderer, MOUSE, TOUCH,
} from "/three/build/three.module.js";
import { OrbitControls } from "/three/examples/jsm/controls/OrbitControls.js";
import { TILE_AREA, TILE_SIDE, TILE_WORDS, coarseOver, facet } from "./map_store.js";

const CHUNK = 128; // cells
const RIM = 1;
const TEXTURE = CHUNK + 2 * RIM;
const STRIDES = [1, 2, 4];
const GLIDE_MS = 400;

const COARSE = 8; // beside a texel's flags: it stands in for cells that have not come

/** A cell as a texel, at `at` of `out`: depth, sigma code + 1, time, flags. */
function texel(tile, k, out, at) {
  const over = tile[k] & 31 ? 0 : coarseOver(tile, k), word = over & 31 ? over : tile[k];
  out[at] = word >>> 8;
  out[at + 1] = word & 31;
  out[at + 2] = over & 31 ? 0 : tile[TILE_AREA + k];
  out[at + 3] = over & 31 ? COARSE : (word >>> 5) & 7;
}

const vertexShader = `
precision highp sampler2D;
uniform sampler2D cells;
uniform vec2 chunk;      // first cell east, north
uniform vec2 centre;     // of the frame, cells
uniform float cell_m;
uniform float exaggeration;
uniform float reference; // depth at y = 0, 1/256 cell
uniform int stride;
varying vec2 corner;
varying float depth;     // 1/256 cell
varying vec2 gradient;   // of depth, east and north
void main() {
  // A corner's depth and slope are those of the known cells around it.
  ivec2 at = ivec2(position.xy);
  float sum = 0.0, count = 0.0;
  vec2 west = vec2(0.0), east = vec2(0.0), south = vec2(0.0), north = vec2(0.0);
  for (int n = -stride; n < stride; ++n) {
    for (int e = -stride; e < stride; ++e) {
      ivec2 texel = clamp(at + ivec2(e, n) + ${RIM}, ivec2(0), ivec2(${TEXTURE - 1}));
      vec4 cell = texelFetch(cells, texel, 0);
      if (cell.g < 0.5) continue;
      sum += cell.r;
      count += 1.0;
      vec2 one = vec2(cell.r, 1.0);
      if (e < 0) west += one; else east += one;
      if (n < 0) south += one; else north += one;
    }
  }
  depth = count > 0.0 ? sum / count : reference;
  float span = float(stride) * 256.0;
  gradient = vec2(west.y * east.y > 0.0 ? (east.x / east.y - west.x / west.y) / span : 0.0,
                  south.y * north.y > 0.0 ? (north.x / north.y - south.x / south.y) / span : 0.0);
  corner = position.xy;
  vec2 place = (position.xy + chunk - centre) * cell_m;
  float height = (reference - depth) / 256.0 * cell_m * exaggeration;
  gl_Position = projectionMatrix * viewMatrix * vec4(place.x, height, -place.y, 1.0);
}`;

const fragmentShader = `
precision highp sampler2D;
uniform sampler2D cells;
uniform sampler2D palette;
uniform int mode;             // 0 depth, 1 uncertainty, 2 age, 3 slope
uniform vec2 range;           // value of the palette's ends
uniform float cell_m;
uniform float top_m;
uniform float exaggeration;
uniform float now_ds;
uniform float contour_m;      // 0: none
uniform float obstacle_m;     // shallower is marked; very small: none
uniform vec3 contour_colour;
uniform float pixel_ratio;
varying vec2 corner;
varying float depth;
varying vec2 gradient;
void main() {
  ivec2 index = clamp(ivec2(floor(corner)), ivec2(0), ivec2(${CHUNK - 1}));
  vec4 cell = texelFetch(cells, index + ${RIM}, 0);
  if (cell.g < 0.5) discard;  // unknown is no surface
  bool coarse = cell.a > ${COARSE - 0.5};
  float depth_m = top_m + depth / 256.0 * cell_m;
  float value = depth_m;
  if (mode == 1) value = exp2((cell.g - 1.0) * 0.5) / 64.0 * cell_m;
  if (mode == 2) value = max(now_ds - cell.b, 0.0) / 10.0;
  if (mode == 3) value = degrees(atan(length(gradient)));
  float share = clamp((value - range.x) / max(range.y - range.x, 1e-6), 0.0, 1.0);
  vec3 colour = texture2D(palette, vec2((share * 255.0 + 0.5) / 256.0, 0.5)).rgb;
  // What is coarse so far has no age, is greyer than the rest, and hatched.
  if (coarse) {
    vec3 grey = vec3(dot(colour, vec3(0.3, 0.59, 0.11)));
    colour = mode == 2 ? vec3(0.5) : mix(grey, colour, 0.4);
  }
  // A lamp in the north-west, weaker ones beside it, and the sky.
  vec3 normal = normalize(vec3(gradient.x * exaggeration, 1.0, -gradient.y * exaggeration));
  float light = 0.42 + 0.48 * max(dot(normal, normalize(vec3(-1.0, 1.1, -1.0))), 0.0) / 0.614
              + 0.07 * max(dot(normal, normalize(vec3(-1.0, 1.0, 0.6))), 0.0)
              + 0.07 * max(dot(normal, normalize(vec3(0.6, 1.0, -1.0))), 0.0);
  colour *= clamp(light, 0.25, 1.25);
  if (coarse && fract((gl_FragCoord.x - gl_FragCoord.y) / (9.0 * pixel_ratio)) < 0.25) colour = mix(colour, vec3(1.0), 0.35);
  // Where merged surveys contradict each other (bit 1 of the flags).
  if (!coarse && mod(floor(cell.a / 2.0), 2.0) > 0.5) {
    vec2 square = floor(gl_FragCoord.xy / (4.0 * pixel_ratio));
    colour = mix(colour, vec3(0.78, 0.0, 0.62), mod(square.x + square.y, 2.0) < 0.5 ? 0.8 : 0.15);
  }
  if (!gl_FrontFacing) colour *= 0.3;  // seen from below, through a gap
  // A coarse cell is flat: where its depth is a contour's, all of it would be one.
  if (contour_m > 0.0 && !coarse) {
    float level = depth_m / contour_m;
    float width = max(fwidth(level), 1e-6);
    float from_line = abs(level - floor(level + 0.5)) / width / pixel_ratio;
    bool thick = mod(floor(level + 0.5), 5.0) < 0.5;
    float line = 1.0 - smoothstep(thick ? 0.7 : 0.4, thick ? 1.4 : 1.0, from_line);
    // A cell that is quite flat at a contour's depth would be one altogether.
    line *= step(2e-5, width);
    // Lines that would touch each other fade.
    line *= (thick ? 0.85 : 0.5) * (1.0 - smoothstep(0.12, 0.3, width));
    colour = mix(colour, contour_colour, line);
  }
  if (!coarse && top_m + cell.r / 256.0 * cell_m < obstacle_m) {
    float stripe = step(0.5, fract((gl_FragCoord.x + gl_FragCoord.y) / (10.0 * pixel_ratio)));
    colour = mix(colour, mix(vec3(0.84, 0.12, 0.16), vec3(1.0, 0.93, 0.93), stripe), 0.86);
  }
  gl_FragColor = vec4(colour, 1.0);
}`;

function lattice(step) {
  const side = CHUNK / step + 1;
  const positions = new Float32Array(3 * side * side);
  for (let row = 0, k = 0; row < side; row++) {
    for (let column = 0; column < side; column++, k += 3) {
      positions[k] = column * step;
      positions[k + 1] = row * step;
    }
  }
  const indices = new Uint32Array(6 * (side - 1) * (side - 1));
  for (let row = 0, k = 0; row < side - 1; row++) {
    for (let column = 0; column < side - 1; column++, k += 6) {
      const a = row * side + column;
      indices.set([a, a + 1, a + side, a + 1, a + side + 1, a + side], k);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(positions, 3));
  geometry.setIndex(new BufferAttribute(indices, 1));
  return geometry;
}

export class SeafloorScene {
  constructor(canvas, onChange) {
    const context = canvas.getContext("webgl2", { antialias: true, alpha: true, powerPreference: "high-performance" });
    if (!context) throw new Error("This browser has no WebGL 2.");
    this.canvas = canvas;
    this.onChange = onChange;
    this.renderer = new WebGLRenderer({ canvas, context, alpha: true });
    this.renderer.setClearColor(0, 0);
    this.scene = new Scene();
    this.perspective = new PerspectiveCamera(42, 1, 0.1, 1e6);
    this.flat = new OrthographicCamera(-1, 1, 1, -1, -1e5, 1e5);
    this.flat.up.set(0, 0, -1);
    this.orbit = new OrbitControls(this.perspective, canvas);
    this.orbit.maxPolarAngle = 1.5;
    this.pan = new OrbitControls(this.flat, canvas);
    this.pan.enableRotate = false;
    this.pan.mouseButtons = { LEFT: MOUSE.PAN, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.PAN };
    this.pan.touches = { ONE: TOUCH.PAN, TWO: TOUCH.DOLLY_PAN };
    for (const control of [this.orbit, this.pan]) {
      control.enableKeys = false;
      control.screenSpacePanning = control === this.pan;
      control.addEventListener("change", () => this.onChange());
    }
    this.geometries = STRIDES.map(lattice);
    this.blank = new Float32Array(4 * TEXTURE * TEXTURE);
    this.patch = new DataTexture(new Float32Array(4 * TILE_AREA), TILE_SIDE, TILE_SIDE, RGBAFormat, FloatType);
    this.palettes = {};
    this.shared = {
      palette: { value: null }, mode: { value: 0 }, range: { value: new Vector2(0, 1) }, centre: { value: new Vector2() },
      cell_m: { value: 1 }, top_m: { value: 0 }, exaggeration: { value: 2 }, reference: { value: 0 }, now_ds: { value: 0 },
      contour_m: { value: 0 }, obstacle_m: { value: -1e9 }, contour_colour: { value: new Vector3(0.03, 0.08, 0.14) },
      pixel_ratio: { value: 1 },
    };
    this.chunks = new Map();
    this.uploads = { count: 0, bytes: 0 };
    this.setView(false);
    canvas.addEventListener("webglcontextrestored", () => this.restore());
  }

  get camera() { return this.mapView ? this.flat : this.perspective; }
  get controls() { return this.mapView ? this.pan : this.orbit; }

  setPalettes(palettes) {
    for (const name of ["depth", "uncertainty"]) {
      const texture = new DataTexture(new Uint8Array(palettes[name]), 256, 1, RGBFormat);
      texture.minFilter = texture.magFilter = LinearFilter;
      texture.wrapS = ClampToEdgeWrapping;
      texture.needsUpdate = true;
      this.palettes[name] = texture;
    }
  }

  /** Another map: nothing of the one before stays. */
  begin(store) {
    for (const chunk of this.chunks.values()) this.#drop(chunk);
    this.chunks.clear();
    this.store = store;
    this.shared.cell_m.value = store.cellM;
    this.shared.top_m.value = store.originM[2];
    this.shared.centre.value.set(store.size[1] / 2, store.size[0] / 2);
    this.shared.reference.value = 0;
    this.centreM = { north: store.originM[0] + (store.size[0] / 2) * store.cellM,
                     east: store.originM[1] + (store.size[1] / 2) * store.cellM };
  }

  #drop(chunk) {
    this.scene.remove(chunk.mesh);
    chunk.texture.dispose();
    chunk.mesh.material.dispose();
  }

  #chunk(column, row) {
    const key = row * 65536 + column;
    let chunk = this.chunks.get(key);
    if (chunk) return chunk;
    const texture = new DataTexture(this.blank, TEXTURE, TEXTURE, RGBAFormat, FloatType);
    texture.minFilter = texture.magFilter = NearestFilter;
    texture.generateMipmaps = false;
    texture.needsUpdate = true;
    const material = new ShaderMaterial({
      vertexShader, fragmentShader, side: DoubleSide,
      uniforms: { ...this.shared, cells: { value: texture }, stride: { value: 1 },
                  chunk: { value: new Vector2(column * CHUNK, row * CHUNK) } },
    });
    const mesh = new Mesh(this.geometries[0], material);
    mesh.frustumCulled = false;
    this.scene.add(mesh);
    chunk = { texture, mesh, column, row };
    this.chunks.set(key, chunk);
    return chunk;
  }

  /** Uploads one tile: into its chunk and, at a chunk's rim, into the neighbours'. */
  setTile(id, tile) {
    const data = this.patch.image.data;
    for (let k = 0; k < TILE_AREA; k++) texel(tile, k, data, 4 * k);
    const tilesPerChunk = CHUNK / TILE_SIDE;
    const row = Math.floor(id / this.store.tilesEast), column = id % this.store.tilesEast;
    const chunkRow = Math.floor(row / tilesPerChunk), chunkColumn = Math.floor(column / tilesPerChunk);
    const north = (row % tilesPerChunk) * TILE_SIDE, east = (column % tilesPerChunk) * TILE_SIDE;
    this.#upload(this.#chunk(chunkColumn, chunkRow), this.patch, east + RIM, north + RIM);
    const last = CHUNK - TILE_SIDE;
    for (const [dr, dc] of [[-1, -1], [-1, 0], [-1, 1], [0, -1], [0, 1], [1, -1], [1, 0], [1, 1]]) {
      const atNorth = dr === 0 || (dr < 0 ? north === 0 : north === last);
      const atEast = dc === 0 || (dc < 0 ? east === 0 : east === last);
      const neighbour = this.chunks.get((chunkRow + dr) * 65536 + chunkColumn + dc);
      if (atNorth && atEast && neighbour) this.#rim(neighbour, data, dr, dc, north, east);
    }
    // A chunk that is new takes the rims of those that were there.
    const chunk = this.#chunk(chunkColumn, chunkRow);
    if (!chunk.rimmed) {
      chunk.rimmed = true;
      this.#fillRim(chunk);
    }
  }

  #upload(chunk, patch, x, y) {
    this.renderer.copyTextureToTexture(new Vector2(x, y), patch, chunk.texture);
    this.uploads.count++;
    this.uploads.bytes += patch.image.data.byteLength;
  }

  /** The row, column or corner of a tile that touches `neighbour` (which lies by dr, dc of the tile's chunk). */
  #rim(neighbour, data, dr, dc, north, east) {
    const height = dr === 0 ? TILE_SIDE : 1, width = dc === 0 ? TILE_SIDE : 1;
    const fromNorth = dr > 0 ? TILE_SIDE - 1 : 0, fromEast = dc > 0 ? TILE_SIDE - 1 : 0;
    const strip = new Float32Array(4 * width * height);
    for (let n = 0; n < height; n++) {
      for (let e = 0; e < width; e++) {
        const from = 4 * ((fromNorth + n) * TILE_SIDE + fromEast + e);
        strip.set(data.subarray(from, from + 4), 4 * (n * width + e));
      }
    }
    const x = dc === 0 ? east + RIM : dc > 0 ? 0 : TEXTURE - 1;
    const y = dr === 0 ? north + RIM : dr > 0 ? 0 : TEXTURE - 1;
    this.#upload(neighbour, new DataTexture(strip, width, height, RGBAFormat, FloatType), x, y);
  }

  #fillRim(chunk) {
    const put = (n, e, out, at) => {
      const north = chunk.row * CHUNK + n, east = chunk.column * CHUNK + e;
      if (north < 0 || east < 0) return false;
      const tile = this.store.tiles.get(Math.floor(north / TILE_SIDE) * this.store.tilesEast + Math.floor(east / TILE_SIDE));
      if (!tile || east >= this.store.tilesEast * TILE_SIDE) return false;
      texel(tile, (north % TILE_SIDE) * TILE_SIDE + (east % TILE_SIDE), out, at);
      return true;
    };
    const sides = [
      { width: TEXTURE, height: 1, x: 0, y: 0, at: (i) => [-1, i - 1] },
      { width: TEXTURE, height: 1, x: 0, y: TEXTURE - 1, at: (i) => [CHUNK, i - 1] },
      { width: 1, height: TEXTURE, x: 0, y: 0, at: (i) => [i - 1, -1] },
      { width: 1, height: TEXTURE, x: TEXTURE - 1, y: 0, at: (i) => [i - 1, CHUNK] },
    ];
    for (const side of sides) {
      const strip = new Float32Array(4 * TEXTURE);
      let any = false;
      for (let i = 0; i < TEXTURE; i++) any = put(...side.at(i), strip, 4 * i) || any;
      if (any) this.#upload(chunk, new DataTexture(strip, side.width, side.height, RGBAFormat, FloatType), side.x, side.y);
    }
  }

  /** Everything again, after the graphics were lost. */
  restore() {
    for (const chunk of this.chunks.values()) this.#drop(chunk);
    this.chunks.clear();
    for (const [id, tile] of this.store?.tiles ?? []) this.setTile(id, tile);
    this.onChange();
  }

  clearTile(id) {
    this.setTile(id, new Uint32Array(TILE_WORDS));
  }

  setView(mapView) {
    this.mapView = mapView;
    this.orbit.enabled = !mapView;
    this.pan.enabled = mapView;
    this.#moved();
  }

  /** A camera was moved: where places are on the screen is right from now on, not from the next picture on. */
  #moved() {
    this.perspective.updateMatrixWorld();
    this.flat.updateMatrixWorld();
    this.onChange();
  }

  resize(width, height, ratio) {
    this.width = width;
    this.height = height;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.shared.pixel_ratio.value = ratio;
    this.perspective.aspect = width / height;
    this.perspective.updateProjectionMatrix();
    this.#sizeFlat();
  }

  #sizeFlat() {
    const half = (this.mapSpanM ?? 100) / 2;
    const aspect = this.width / this.height;
    this.flat.left = -half * aspect;
    this.flat.right = half * aspect;
    this.flat.top = half;
    this.flat.bottom = -half;
    this.flat.updateProjectionMatrix();
  }

  /** Both cameras on what is known (or on the whole grid while nothing is), in 3-D on the vehicle too where it is near; margins in pixels: left, right, top, bottom. */
  fit(margins, vehicle = null) {
    const store = this.store;
    if (!store) return;
    const b = store.bounds ?? { north0: 0, north1: store.size[0], east0: 0, east1: store.size[1] };
    if (store.shown) this.shared.reference.value = ((store.depthQuantile(0.5) - store.originM[2]) / store.cellM) * 256;
    const spanNorth = (b.north1 - b.north0) * store.cellM, spanEast = (b.east1 - b.east0) * store.cellM;
    const x = ((b.east0 + b.east1) / 2 - store.size[1] / 2) * store.cellM;
    const z = -((b.north0 + b.north1) / 2 - store.size[0] / 2) * store.cellM;
    const freeWidth = Math.max(this.width - margins.left - margins.right, 80);
    const freeHeight = Math.max(this.height - margins.top - margins.bottom, 80);
    this.mapSpanM = 1.06 * Math.max((spanNorth * this.height) / freeHeight,
      (spanEast * this.width) / freeWidth * (this.height / this.width), 4 * store.cellM);
    this.flat.zoom = 1;
    this.#sizeFlat();
    const perPixel = this.mapSpanM / this.height;
    const shiftX = ((margins.right - margins.left) / 2) * perPixel;
    const shiftZ = ((margins.bottom - margins.top) / 2) * perPixel;
    this.pan.target.set(x + shiftX, 0, z + shiftZ);
    this.flat.position.set(x + shiftX, 100, z + shiftZ);
    const distance = this.#frame3d(this.#corners(vehicle), x, z, Math.max(spanEast, spanNorth), margins, freeWidth, freeHeight);
    this.perspective.near = distance / 500;
    this.perspective.far = distance * 30;
    this.perspective.updateProjectionMatrix();
    this.orbit.update();
    this.pan.update();
    this.#moved();
  }

  /** As fit(), but the view glides there: glideOn() moves it. */
  glideTo(margins, vehicle) {
    const views = () => ({ reference: this.shared.reference.value, span: this.mapSpanM / this.flat.zoom,
      places: [this.perspective.position, this.orbit.target, this.flat.position, this.pan.target].map((place) => place.clone()) });
    const from = views();
    this.fit(margins, vehicle);
    const to = views();
    // The fit may have moved the depth that heights are drawn from: what is seen must not hop.
    const upM = ((to.reference - from.reference) / 256) * this.store.cellM * this.shared.exaggeration.value;
    for (const place of from.places.slice(0, 2)) place.y += upM;
    this.glide = { from, to, begunMs: null };
    this.glideOn(null);
  }

  /** Moves a view that glides; `nowMs` is the picture's time, null: its beginning. */
  glideOn(nowMs) {
    const { from, to, begunMs } = this.glide;
    if (nowMs !== null && begunMs === null) this.glide.begunMs = nowMs;
    const t = nowMs === null || begunMs === null ? 0 : Math.min((nowMs - begunMs) / GLIDE_MS, 1);
    const share = t * t * (3 - 2 * t);
    [this.perspective.position, this.orbit.target, this.flat.position, this.pan.target].forEach((place, i) =>
      place.copy(from.places[i]).lerp(to.places[i], share));
    this.mapSpanM = from.span + (to.span - from.span) * share;
    this.#sizeFlat();
    this.orbit.update();
    this.pan.update();
    if (t >= 1) this.glide = null;
    this.#moved();
  }

  /** The corners of what is to be seen. */
  #corners(vehicle) {
    const store = this.store;
    const b = store.bounds ?? { north0: 0, north1: store.size[0], east0: 0, east1: store.size[1] };
    const corners = [];
    for (const share of [0.001, 0.999]) {
      const downM = store.depthQuantile(share);
      for (const north of [b.north0, b.north1]) {
        for (const east of [b.east0, b.east1]) {
          corners.push(this.world({ northM: store.originM[0] + north * store.cellM, eastM: store.originM[1] + east * store.cellM, downM }));
        }
      }
    }
    const at = vehicle && store.shown && !this.mapView ? this.world(vehicle) : null;
    const [low, high] = [corners[0], corners[3]];
    const far = 0.25 * Math.max(Math.abs(high.x - low.x), Math.abs(high.z - low.z));
    if (at && at.x > low.x - far && at.x < high.x + far && at.z < low.z + far && at.z > high.z - far) corners.push(at);
    return corners;
  }

  /** Where corners are on the screen: left, right, top, bottom. */
  #extent(corners, camera) {
    const seen = corners.map((corner) => corner.clone().project(camera));
    const xs = seen.map((p) => ((p.x + 1) / 2) * this.width), ys = seen.map((p) => ((1 - p.y) / 2) * this.height);
    return { left: Math.min(...xs), right: Math.max(...xs), top: Math.min(...ys), bottom: Math.max(...ys) };
  }

  /** Whether the view still shows it all and not too small: a map that grows need not move it each time. */
  framed(margins, vehicle) {
    const seen = this.#extent(this.#corners(vehicle), this.camera), slack = 12;
    const width = this.width - margins.left - margins.right, height = this.height - margins.top - margins.bottom;
    return seen.left > margins.left - slack && seen.right < this.width - margins.right + slack && seen.top > margins.top - slack &&
      seen.bottom < this.height - margins.bottom + slack &&
      Math.max((seen.right - seen.left) / width, (seen.bottom - seen.top) / height) > 0.6;
  }

  /** Looks from the south, so far away that the corners just fit into what is free; returns how far. */
  #frame3d(corners, x, z, spanM, margins, freeWidth, freeHeight) {
    const camera = this.perspective;
    const target = new Vector3(x, 0, z), back = new Vector3(0, 0.62, 0.785).normalize();
    const reach = Math.max(spanM, 4 * this.store.cellM, ...corners.map((corner) => corner.distanceTo(target)));
    // From far away, and never so near that a corner is beside the viewer or behind him: its place on the screen would
    // mean nothing.
    let distance = 4 * reach;
    // What is nearer than the target moves more than was reckoned: a part of each correction comes to rest, all of it swings.
    const part = 0.6;
    for (let round = 0; round < 32; round++) {
      camera.position.copy(target).addScaledVector(back, distance);
      camera.near = distance / 500;
      camera.far = distance * 30;
      camera.lookAt(target);
      camera.updateProjectionMatrix();
      camera.updateMatrixWorld();
      const { left, right, top, bottom } = this.#extent(corners, camera);
      const perPixel = (2 * distance * Math.tan((camera.fov * Math.PI) / 360)) / this.height;
      // What is seen goes to the middle of what is free: sideways, and along the ground.
      target.x += part * ((left + right) / 2 - (margins.left + this.width - margins.right) / 2) * perPixel;
      target.z += (part * ((top + bottom) / 2 - (margins.top + this.height - margins.bottom) / 2) * perPixel) / back.y;
      distance *= Math.max(1.08 * Math.max((right - left) / freeWidth, (bottom - top) / freeHeight), 0.1) ** part;
      const nearest = Math.max(...corners.map((corner) => corner.clone().sub(target).dot(back)));
      distance = Math.max(distance, nearest + 0.2 * reach);
    }
    this.orbit.target.copy(target);
    camera.position.copy(target).addScaledVector(back, distance);
    return distance;
  }

  /** Moves the view's middle to a place. */
  lookAt(place) {
    const to = this.world(place);
    for (const [camera, controls] of [[this.perspective, this.orbit], [this.flat, this.pan]]) {
      const by = to.clone().sub(controls.target);
      if (camera === this.flat) by.y = 0;
      controls.target.add(by);
      camera.position.add(by);
    }
    this.orbit.update();
    this.pan.update();
    this.#moved();
  }

  /** Moves by a share of the window. */
  nudge(right, up) {
    const camera = this.camera;
    const size = this.mapView ? this.mapSpanM / this.flat.zoom
      : 2 * camera.position.distanceTo(this.orbit.target) * Math.tan((camera.fov * Math.PI) / 360);
    const along = new Vector3().setFromMatrixColumn(camera.matrix, 0);
    const ahead = this.mapView ? new Vector3(0, 0, -1) : new Vector3(along.z, 0, -along.x);
    const by = along.multiplyScalar(right * size).add(ahead.multiplyScalar(up * size));
    this.controls.target.add(by);
    camera.position.add(by);
    this.controls.update();
    this.#moved();
  }

  turn(rightDeg, upDeg) {
    if (this.mapView) return;
    const arm = this.perspective.position.clone().sub(this.orbit.target);
    const radius = arm.length();
    const azimuth = Math.atan2(arm.x, arm.z) + (rightDeg * Math.PI) / 180;
    const polar = Math.min(Math.max(Math.acos(arm.y / radius) - (upDeg * Math.PI) / 180, 0.02), 1.5);
    this.perspective.position.copy(this.orbit.target).add(new Vector3(
      radius * Math.sin(polar) * Math.sin(azimuth), radius * Math.cos(polar), radius * Math.sin(polar) * Math.cos(azimuth)));
    this.orbit.update();
    this.#moved();
  }

  zoom(factor) {
    if (this.mapView) {
      this.flat.zoom *= factor;
      this.flat.updateProjectionMatrix();
    } else {
      const arm = this.perspective.position.clone().sub(this.orbit.target).divideScalar(factor);
      this.perspective.position.copy(this.orbit.target).add(arm);
    }
    this.controls.update();
    this.#moved();
  }

  /** A place of the survey's frame (metres) in the scene. */
  world({ northM, eastM, downM }) {
    const reference = this.store.originM[2] + (this.shared.reference.value / 256) * this.store.cellM;
    return new Vector3(eastM - this.centreM.east, (reference - downM) * this.shared.exaggeration.value,
      -(northM - this.centreM.north));
  }

  /** Depth of what is drawn at a place; where nothing is, of the plane that heights are drawn from. */
  groundM({ northM, eastM }) {
    return this.store.surfaceAt(northM, eastM) ?? this.store.originM[2] + (this.shared.reference.value / 256) * this.store.cellM;
  }

  /** Where a place is on the screen; null: behind the viewer. */
  project(place) {
    const at = this.world(place).project(this.camera);
    if (at.z > 1 || at.z < -1) return null;
    return { x: ((at.x + 1) / 2) * this.width, y: ((1 - at.y) / 2) * this.height };
  }

  /** Metres per pixel at the view's middle. */
  metresPerPixel() {
    return this.mapView ? this.mapSpanM / this.flat.zoom / this.height
      : (2 * this.perspective.position.distanceTo(this.orbit.target) *
          Math.tan((this.perspective.fov * Math.PI) / 360)) / this.height;
  }

  /** The place under a point of the screen: where the ray meets what is drawn, else (map, or a ray that goes down) where
      it leaves the reference depth, where nothing is drawn. Null: the sky. */
  pick(x, y) {
    const store = this.store;
    if (!store) return null;
    this.camera.updateMatrixWorld();
    const near = new Vector3((2 * x) / this.width - 1, 1 - (2 * y) / this.height, -1).unproject(this.camera);
    const far = new Vector3((2 * x) / this.width - 1, 1 - (2 * y) / this.height, 1).unproject(this.camera);
    const referenceM = store.originM[2] + (this.shared.reference.value / 256) * store.cellM;
    const exaggeration = this.shared.exaggeration.value;
    // In cells, and metres of depth.
    const place = (v) => ({ n: (-v.z + this.centreM.north - store.originM[0]) / store.cellM,
                            e: (v.x + this.centreM.east - store.originM[1]) / store.cellM,
                            d: referenceM - v.y / exaggeration });
    const from = place(near), to = place(far);
    const by = { n: to.n - from.n, e: to.e - from.e, d: to.d - from.d };
    if (this.mapView) {
      return { northM: store.originM[0] + from.n * store.cellM, eastM: store.originM[1] + from.e * store.cellM };
    }
    const hit = this.#march(from, by);
    if (hit) return hit;
    const t = (referenceM - from.d) / by.d;
    if (!(by.d > 0) || !(t > 0) || t > 1) return null;
    const n = from.n + t * by.n, e = from.e + t * by.e;
    // Past the rim of the seafloor and over or under another part of it: that part is not what is pointed at.
    if (store.drawnQ8(Math.floor(n), Math.floor(e)) >= 0) return null;
    return { northM: store.originM[0] + n * store.cellM, eastM: store.originM[1] + e * store.cellM };
  }

  /** Cell by cell along the ray: where it first meets what is drawn. */
  #march(from, by) {
    const store = this.store;
    let t0 = 0, t1 = 1;
    for (const [axis, size] of [["n", store.size[0]], ["e", store.size[1]]]) {
      if (Math.abs(by[axis]) < 1e-12) continue;
      const a = (0 - from[axis]) / by[axis], b = (size - from[axis]) / by[axis];
      t0 = Math.max(t0, Math.min(a, b));
      t1 = Math.min(t1, Math.max(a, b));
    }
    if (!(t1 > t0)) return null;
    let n = Math.floor(from.n + t0 * by.n + 1e-9 * Math.sign(by.n));
    let e = Math.floor(from.e + t0 * by.e + 1e-9 * Math.sign(by.e));
    let t = t0;
    for (let steps = 0; steps < 40000 && t < t1; steps++) {
      const nextN = by.n === 0 ? Infinity : ((by.n > 0 ? n + 1 : n) - from.n) / by.n;
      const nextE = by.e === 0 ? Infinity : ((by.e > 0 ? e + 1 : e) - from.e) / by.e;
      const leave = Math.min(nextN, nextE, t1);
      if (store.drawnQ8(n, e) >= 0) {
        const hit = this.#cross(from, by, n, e, t, leave);
        if (hit) return hit;
      }
      if (nextN <= nextE) n += Math.sign(by.n); else e += Math.sign(by.e);
      t = leave;
    }
    return null;
  }

  /** Where the ray, which is over cell n, e from t0 to t1, goes through the cell's two triangles. */
  #cross(from, by, n, e, t0, t1) {
    const store = this.store, corners = store.corners(n, e);
    const inside = (share) => Math.min(Math.max(share, 0), 1 - 1e-9);
    const at = (t) => ({ n: inside(from.n + t * by.n - n), e: inside(from.e + t * by.e - e) });
    const under = (t) => {
      const { n: north, e: east } = at(t);
      return from.d + t * by.d - store.originM[2] - (facet(corners, north, east) * store.cellM) / 256;
    };
    // The line where the triangles meet.
    const seam = (n + e + 1 - from.n - from.e) / (by.n + by.e);
    const stops = seam > t0 && seam < t1 ? [t0, seam, t1] : [t0, t1];
    for (let i = 1; i < stops.length; i++) {
      const a = under(stops[i - 1]), b = under(stops[i]);
      if (a * b > 0) continue;
      const { n: north, e: east } = at(a === b ? stops[i] : stops[i - 1] + ((stops[i] - stops[i - 1]) * a) / (a - b));
      return { northM: store.originM[0] + (n + north) * store.cellM, eastM: store.originM[1] + (e + east) * store.cellM };
    }
    return null;
  }

  render() {
    if (!this.width) return;
    this.#hideUnseen();
    // Where cells are smaller than pixels, a coarser mesh shows as much.
    for (const chunk of this.chunks.values()) {
      const level = this.#level(chunk);
      chunk.mesh.geometry = this.geometries[level];
      chunk.mesh.material.uniforms.stride.value = STRIDES[level];
    }
    this.renderer.render(this.scene, this.camera);
  }

  /** Chunks beside the view cost nothing. */
  #hideUnseen() {
    const store = this.store;
    if (!store) return;
    this.camera.updateMatrixWorld();
    const seen = new Frustum();
    seen.setFromMatrix(new Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse));
    const [shallowM, deepM] = [store.depthQuantile(0) - store.cellM, store.depthQuantile(1) + store.cellM];
    for (const { mesh, column, row } of this.chunks.values()) {
      const corner = (north, east, downM) => this.world({ northM: store.originM[0] + north * CHUNK * store.cellM,
        eastM: store.originM[1] + east * CHUNK * store.cellM, downM });
      mesh.visible = seen.intersectsBox(new Box3().setFromPoints([corner(row, column, shallowM), corner(row + 1, column + 1, deepM)]));
    }
  }

  #level(chunk) {
    let perPixel = this.metresPerPixel();
    if (!this.mapView) {
      const middle = new Vector3((chunk.column * CHUNK + CHUNK / 2 - this.store.size[1] / 2) * this.store.cellM, 0,
        -(chunk.row * CHUNK + CHUNK / 2 - this.store.size[0] / 2) * this.store.cellM);
      const near = Math.max(middle.distanceTo(this.perspective.position) - CHUNK * this.store.cellM * 0.7, 1e-3);
      perPixel *= near / this.perspective.position.distanceTo(this.orbit.target);
    }
    const pixelsPerCell = this.store.cellM / perPixel;
    return pixelsPerCell < 0.6 ? 2 : pixelsPerCell < 1.2 ? 1 : 0;
  }
}

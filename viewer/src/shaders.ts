/** GLSL. The colour maths is that of src/color/colorspace_math.h, the integral that of bake/volume/integrate.h. */

/** Levels that a bundle may have; a bake makes four at most. */
export const mostLevels = 8;

export const fullScreen = `#version 300 es
void main() {
  vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  gl_Position = vec4(corner, 0.0, 1.0);
}`;

const color = `
// XYZ relative to white; a grey has three equal components.
vec3 rgbFromXyz(vec3 c) {
  float x = c.x - c.y, z = c.z - c.y;
  return vec3(c.y + 3.079954467464594 * x - 0.542815954666877 * z,
              c.y - 0.921258284014265 * x + 0.045247438567571 * z,
              c.y + 0.052887411823710 * x + 1.151138501693044 * z);
}
float luminanceOf(vec3 c) { return c.y + 0.212672851405622 * (c.x - c.y) + 0.072174993306560 * (c.z - c.y); }
vec3 xyzFromRgb(vec3 c) {
  float r = c.x - c.y, b = c.z - c.y;
  return vec3(c.y + 0.433949981682422 * r + 0.189840271935357 * b, luminanceOf(c),
              c.y + 0.017756578696701 * r + 0.872775436511088 * b);
}
vec3 fromLabF(vec3 f) {
  vec3 cube = f * f * f;
  return mix((116.0 * f - 16.0) * (27.0 / 24389.0), cube, greaterThan(cube, vec3(216.0 / 24389.0)));
}
vec3 toLabF(vec3 c) {
  return mix((c * (24389.0 / 27.0) + 16.0) / 116.0, pow(max(c, 1e-9), vec3(1.0 / 3.0)), greaterThan(c, vec3(216.0 / 24389.0)));
}
vec3 srgbFromLinear(vec3 c) {
  c = clamp(c, 0.0, 1.0);
  return mix(12.92 * c, 1.055 * pow(max(c, 1e-6), vec3(1.0 / 2.4)) - 0.055, greaterThan(c, vec3(0.0031308)));
}
vec3 linearFromSrgb(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045))); }
`;

/**
 * Emission and absorption along one ray a pixel, in voxels of the coarsest level. At every point the finest level
 * counts that covers it and has the brick; steps are as long as its voxels. Levels are whole in themselves: where a
 * coarser one is empty, finer ones are too. Writes linear Rec.709, premultiplied, and opacity.
 */
export const march = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler3D;
precision highp usampler3D;
uniform usampler3D u_index;   // [bricks] place in the atlas, and bricks to the nearest stored one; 255 = left out
uniform sampler3D u_density;  // atlas: optical depth of a voxel of its level
uniform sampler3D u_lab;      // atlas: L*, a, b
uniform int u_levels;         // coarsest first
uniform vec3 u_cover_low[${mostLevels}], u_cover_high[${mostLevels}];
uniform vec4 u_place[${mostLevels}];  // a level's voxels = coarsest * w + xyz
uniform ivec4 u_grid[${mostLevels}];  // bricks along each axis, and where they begin in the index along z
uniform vec3 u_texel;         // 1 / texels of the atlas
uniform vec3 u_eye;
uniform mat3 u_right_down_forward;
uniform vec4 u_lens;          // fx, fy, cx, cy in pixels of this target
uniform vec2 u_offset;        // of the ray within its pixel
uniform float u_height;
uniform vec3 u_low, u_high;   // clip box
uniform float u_step;         // voxels of the level that is marched
uniform float u_gain;
uniform float u_threshold;    // optical depth of a voxel below which there is nothing
uniform float u_end;          // transmittance at which a ray is opaque
uniform float u_noise;
uniform int u_slice;          // -1, or the axis the plane is across
uniform float u_slice_at;
uniform int u_quantity;       // of slices: 0 density, 1 L*, 2 a, 3 b
uniform float u_density_max;  // optical depth of a voxel that slices show brightest
out vec4 o_light;
${color}
// The brick of a level around a point, p in its voxels.
uvec4 brickOf(vec3 p, ivec4 grid, out ivec3 cell) {
  cell = clamp(ivec3(floor(p * 0.125)), ivec3(0), grid.xyz - 1);
  return texelFetch(u_index, cell + ivec3(0, 0, grid.w), 0);
}
vec3 texelOf(uvec4 brick, vec3 p, ivec3 cell) {
  return (vec3(brick.xyz) * 10.0 + 1.0 + (p - vec3(cell) * 8.0)) * u_texel;
}
vec3 ramp(float t) {
  vec3 a = vec3(0.02, 0.02, 0.06), b = vec3(0.36, 0.09, 0.45), c = vec3(0.93, 0.36, 0.22), d = vec3(1.0, 0.95, 0.62);
  return linearFromSrgb(t < 0.33 ? mix(a, b, t / 0.33) : t < 0.66 ? mix(b, c, (t - 0.33) / 0.33) : mix(c, d, (t - 0.66) / 0.34));
}
vec3 diverging(float v, vec3 low, vec3 high) {
  float t = clamp(v / 80.0, -1.0, 1.0);
  return linearFromSrgb(mix(vec3(0.93), t < 0.0 ? low : high, abs(t)));
}
vec4 sliceColor(vec3 p) {
  int level = u_levels - 1;
  while (level > 0 && (any(lessThan(p, u_cover_low[level])) || any(greaterThan(p, u_cover_high[level])))) --level;
  vec3 q;
  ivec3 cell;
  uvec4 brick;
  for (;; --level) {
    q = p * u_place[level].w + u_place[level].xyz;
    brick = brickOf(q, u_grid[level], cell);
    if (brick.w < 255u || level == 0) break;
  }
  vec4 nothing = vec4(vec3(0.012), 0.55);
  if (brick.w > 0u) return nothing;
  vec3 at = texelOf(brick, q, cell);
  float depth = textureLod(u_density, at, 0.0).r * u_place[level].w;
  vec3 lab = textureLod(u_lab, at, 0.0).rgb * 255.0;
  if (u_quantity == 0) return depth > 0.0 ? vec4(ramp(pow(clamp(depth / u_density_max, 0.0, 1.0), 0.4)), 1.0) : nothing;
  if (depth <= 0.0) return nothing;
  if (u_quantity == 1) return vec4(linearFromSrgb(vec3(lab.x / 255.0)), 1.0);
  if (u_quantity == 2) return vec4(diverging(lab.y - 128.0, vec3(0.05, 0.6, 0.45), vec3(0.8, 0.1, 0.55)), 1.0);
  return vec4(diverging(lab.z - 128.0, vec3(0.15, 0.35, 0.85), vec3(0.85, 0.65, 0.0)), 1.0);
}
void main() {
  vec2 pixel = vec2(gl_FragCoord.x - 0.5 + u_offset.x, u_height - gl_FragCoord.y - 0.5 + u_offset.y);
  vec3 d = normalize(u_right_down_forward * vec3((pixel - u_lens.zw) / u_lens.xy, 1.0));
  d = mix(d, vec3(1e-7), lessThan(abs(d), vec3(1e-7)));
  vec3 inv = 1.0 / d;
  vec3 a = (u_low - u_eye) * inv, b = (u_high - u_eye) * inv;
  vec3 near = min(a, b), far = max(a, b);
  float begin = max(max(near.x, near.y), max(near.z, 0.0));
  float end = min(far.x, min(far.y, far.z));
  o_light = vec4(0.0);
  if (begin >= end) return;
  if (u_slice >= 0) {
    float t = (u_slice_at - u_eye[u_slice]) * inv[u_slice];
    if (t >= begin && t <= end) {
      vec4 c = sliceColor(u_eye + d * t);
      o_light = vec4(c.rgb * c.a, c.a);
    }
    return;
  }
  float noise = fract(52.9829189 * fract(dot(floor(gl_FragCoord.xy), vec2(0.06711056, 0.00583715))) + u_noise);
  float t = begin;
  float bound = begin;  // how far the level goes on
  float stride = u_step;
  int level = 0;
  vec4 place = u_place[0];
  ivec4 grid = u_grid[0];
  vec3 light = vec3(0.0);
  float transmittance = 1.0;
  vec3 forward = step(0.0, d);
  for (int i = 0; i < 8192; ++i) {
    if (t >= end) break;
    if (t >= bound) {
      level = 0;
      bound = end;
      for (int finer = 1; finer < u_levels; ++finer) {
        vec3 a = (u_cover_low[finer] - u_eye) * inv, b = (u_cover_high[finer] - u_eye) * inv;
        vec3 near = min(a, b), far = max(a, b);
        float enter = max(near.x, max(near.y, near.z)), leave = min(far.x, min(far.y, far.z));
        if (enter >= leave || leave <= t) continue;
        if (enter <= t) {
          level = finer;
          bound = min(end, leave);
        } else {
          bound = min(bound, enter);
        }
      }
      place = u_place[level];
      grid = u_grid[level];
      stride = u_step / place.w;
    }
    float len = min(stride, bound - t);
    vec3 p = u_eye + d * (t + noise * len);
    float scale = place.w;
    vec3 q = p * scale + place.xyz;
    ivec3 cell;
    uvec4 brick = brickOf(q, grid, cell);
    for (int coarser = level - 1; brick.w == 255u && coarser >= 0; --coarser) {  // left out
      scale = u_place[coarser].w;
      q = p * scale + u_place[coarser].xyz;
      brick = brickOf(q, u_grid[coarser], cell);
    }
    if (brick.w > 0u) {
      // All bricks less than w away are empty too: leave their box, in whole steps.
      float reach = float(brick.w) - 1.0;
      vec3 wall = (vec3(cell) + mix(vec3(-reach), vec3(1.0 + reach), forward)) * 8.0;
      vec3 exits = (wall - q) * inv;
      float exit = min(exits.x, min(exits.y, exits.z)) / scale;
      t = min(bound, t + max(ceil(exit / stride), 1.0) * stride);
      continue;
    }
    vec3 at = texelOf(brick, q, cell);
    float depth = textureLod(u_density, at, 0.0).r * scale;
    if (depth > u_threshold) {
      float alpha = 1.0 - exp(-depth * u_gain * len);
      vec3 lab = textureLod(u_lab, at, 0.0).rgb * vec3(100.0, 255.0, 255.0) - vec3(0.0, 128.0, 128.0);
      float fy = (lab.x + 16.0) / 116.0;
      light += fromLabF(vec3(fy + lab.y / 500.0, fy, fy - lab.z / 200.0)) * (transmittance * alpha);
      transmittance *= 1.0 - alpha;
      if (transmittance < u_end) break;
    }
    t = len < stride ? bound : t + stride;
  }
  float opacity = transmittance < u_end ? 1.0 : 1.0 - transmittance;
  o_light = vec4(max(rgbFromXyz(light), 0.0), opacity);
}`;

export const copy = `#version 300 es
precision highp float;
uniform sampler2D u_image;
uniform vec2 u_size;
out vec4 o_light;
void main() { o_light = texture(u_image, gl_FragCoord.xy / u_size); }`;

/** Light -> screen: grade, wipe, background, sRGB. */
export const display = `#version 300 es
precision highp float;
uniform sampler2D u_image;
uniform vec2 u_size;
uniform float u_wipe;        // share of the width, from the left, that is shown without colour
uniform float u_saturation;
uniform vec2 u_hue;          // cosine and sine
uniform float u_exposure;    // factor
uniform vec4 u_background;   // linear; alpha 0 = transparent
uniform bool u_plain;        // slices: colours are a scale, not light
uniform bool u_has_sky;      // is the background, by the direction of view
uniform sampler2D u_sky;     // equirectangular: +x in the middle, +z up, +y a quarter to the left; sRGB
uniform mat3 u_right_down_forward;
uniform vec4 u_lens;         // fx, fy, cx, cy in pixels of this target
out vec4 o_color;
${color}
vec3 graded(vec3 c) {
  float y = luminanceOf(c);
  vec3 f = toLabF(xyzFromRgb(c));
  vec2 ab = vec2(500.0 * (f.x - f.y), 200.0 * (f.y - f.z)) * u_saturation;
  ab = vec2(u_hue.x * ab.x - u_hue.y * ab.y, u_hue.y * ab.x + u_hue.x * ab.y);
  c = rgbFromXyz(fromLabF(vec3(f.y + ab.x / 500.0, f.y, f.y - ab.y / 200.0)));
  // What leaves the gamut loses chroma at its own luminance; channels are not clipped.
  float limit = max(1.0, y), keep = 1.0;
  for (int i = 0; i < 3; ++i) {
    if (c[i] < 0.0) keep = min(keep, y / (y - c[i]));
    if (c[i] > limit) keep = min(keep, (limit - y) / (c[i] - y));
  }
  return mix(vec3(y), c, clamp(keep, 0.0, 1.0));
}
vec3 skyAt(vec2 pixel) {
  vec3 d = normalize(u_right_down_forward * vec3((pixel - u_lens.zw) / u_lens.xy, 1.0));
  vec2 place = vec2(0.5 - atan(d.y, d.x) / 6.283185307, 0.5 - atan(d.z, length(d.xy)) / 3.141592654);
  return linearFromSrgb(textureLod(u_sky, place, 0.0).rgb);
}
void main() {
  vec2 at = gl_FragCoord.xy / u_size;
  vec4 light = texture(u_image, at);
  if (u_has_sky) light = vec4(light.rgb + (1.0 - light.a) * skyAt(vec2(gl_FragCoord.x, u_size.y - gl_FragCoord.y)), 1.0);
  vec3 c = light.a > 1e-4 ? light.rgb / light.a : vec3(0.0);
  if (!u_plain) {
    if (at.x < u_wipe) c = vec3(luminanceOf(c));
    else if (u_saturation != 1.0 || u_hue.y != 0.0 || u_hue.x != 1.0) c = graded(c);
    c *= u_exposure;
  }
  float alpha = clamp(light.a, 0.0, 1.0);
  if (u_background.a > 0.0) {
    o_color = vec4(srgbFromLinear(c * alpha + u_background.rgb * (1.0 - alpha)), 1.0);
  } else {
    o_color = vec4(srgbFromLinear(c), alpha);
  }
}`;

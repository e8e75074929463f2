#include "src/sample/textures.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "src/base/rng.h"
#include "src/color/colorspace_math.h"

namespace cnerf::sample {
namespace {

/// Linear light of a colour written as on the web, 0xRRGGBB.
Vec3d web_color(unsigned hex) {
  const auto channel = [&](int shift) { return linear_from_srgb(double(hex >> shift & 0xFF) / 255.0); };
  return {channel(16), channel(8), channel(0)};
}

Vec3d mix(Vec3d from, Vec3d to, double amount) {
  return from + (to - from) * amount;
}
double smooth_step(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}
double fraction(double x) {
  return x - std::floor(x);
}

/// A value in [0, 1) for each cell of the integer lattice.
double lattice(std::int64_t x, std::int64_t y, std::int64_t z) {
  const auto bits = [](std::int64_t v) { return std::uint64_t(v); };
  return double(mix_bits(bits(x) * 0x9e3779b1u ^ bits(y) * 0x85ebca77u << 16 ^ bits(z) * 0xc2b2ae3du << 32) >> 40) *
         0x1p-24;
}

double value_noise(Vec3d p) {
  const Vec3d cell = {std::floor(p.x), std::floor(p.y), std::floor(p.z)};
  const auto fade = [](double t) { return t * t * (3 - 2 * t); };
  const double u = fade(p.x - cell.x);
  const double v = fade(p.y - cell.y);
  const double w = fade(p.z - cell.z);
  const auto corner = [&](int i, int j, int k) {
    return lattice(std::int64_t(cell.x) + i, std::int64_t(cell.y) + j, std::int64_t(cell.z) + k);
  };
  const auto edge = [&](int j, int k) { return std::lerp(corner(0, j, k), corner(1, j, k), u); };
  return std::lerp(std::lerp(edge(0, 0), edge(1, 0), v), std::lerp(edge(0, 1), edge(1, 1), v), w);
}

/// 1 inside bands of the given share of a period of 1, with soft borders.
double bands(double x, double share, double softness) {
  const double distance = std::abs(fraction(x) - 0.5);
  return 1 - smooth_step(0.5 * share - softness, 0.5 * share + softness, distance);
}

}  // namespace

double noise(Vec3d position, int octaves) {
  double sum = 0;
  double strength = 1;
  double total = 0;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += strength * value_noise(position);
    total += strength;
    strength *= 0.5;
    position = position * 2.03 + Vec3d{17.3, 5.1, 9.7};
  }
  return sum / total;
}

Vec3d planks(Vec3d p) {
  static const Vec3d dark = web_color(0x7d4c26);
  static const Vec3d light = web_color(0xc99a63);
  static const Vec3d gap = web_color(0x3a2313);
  constexpr double kWidth = 0.17;
  const double board = std::floor(p.y / kWidth);
  const double shift = lattice(std::int64_t(board), 7, 3);
  const double x = p.x + 3 * shift;
  const double warp = noise({2.5 * x, 9 * p.y, board}, 2);
  const double grain = 0.5 + 0.5 * std::sin(38 * p.y + 9 * warp + 20 * shift);
  const double fine = noise({7 * x, 60 * p.y, board}, 2);
  const Vec3d wood = mix(dark, light, std::clamp(0.15 + 0.35 * grain + 0.3 * fine + 0.45 * (shift - 0.4), 0.0, 1.0));
  const double seam = 1 - bands(p.y / kWidth, 0.93, 0.03);
  return mix(wood, gap, 0.85 * seam);
}

Vec3d striped_ball(Vec3d p) {
  static const Vec3d red = web_color(0xb5281f);
  static const Vec3d bright = web_color(0xd9513a);
  static const Vec3d cream = web_color(0xe9dcc0);
  const double mottled = noise(p * 16.0, 3);
  const double stripe = bands(p.z * 3.2 + 0.5, 0.22, 0.02);
  const Vec3d body = mix(red, bright, smooth_step(0.3, 0.7, mottled));
  return mix(body, cream * (0.8 + 0.3 * mottled), stripe);
}

Vec3d blue_checker(Vec3d p) {
  static const Vec3d deep = web_color(0x24478f);
  static const Vec3d pale = web_color(0x86abdd);
  constexpr double kSide = 0.095;
  // Half a cell off, so that the faces of a box do not lie on a border between two cells.
  const auto cell = [&](double v) { return std::int64_t(std::floor(v / kSide + 0.5)); };
  const bool odd = ((cell(p.x) + cell(p.y) + cell(p.z)) & 1) != 0;
  return (odd ? deep : pale) * (0.75 + 0.4 * noise(p * 22.0, 2));
}

Vec3d foliage(Vec3d p) {
  static const Vec3d shade = web_color(0x234f1e);
  static const Vec3d leaf = web_color(0x5c9136);
  static const Vec3d tip = web_color(0xa8c858);
  const double angle = std::atan2(p.y, p.x);
  const double needles = 0.5 + 0.5 * std::sin(18 * angle + 30 * p.z + 6 * noise(p * 8.0, 2));
  const double clumps = noise(p * 18.0, 3);
  const Vec3d green = mix(shade, leaf, std::clamp(0.6 * needles + 0.6 * clumps, 0.0, 1.0));
  return mix(green, tip, 0.7 * smooth_step(0.62, 0.8, clumps));
}

Vec3d terracotta(Vec3d p) {
  static const Vec3d clay = web_color(0xb8623b);
  static const Vec3d burnt = web_color(0x7d3a22);
  return mix(clay, burnt, 0.75 * bands(p.z * 14, 0.35, 0.06)) * (0.75 + 0.4 * noise(p * 24.0, 2));
}

Vec3d yellow_spots(Vec3d p) {
  static const Vec3d yellow = web_color(0xe6bd35);
  static const Vec3d brown = web_color(0x8a5518);
  // On the mantle u runs around the axis; on the lid the spots are laid out over x and y.
  const bool lid = std::abs(p.z) > 0.2099;
  const double u = lid ? p.x / 0.115 : std::atan2(p.y, p.x) * 10 / (2 * std::numbers::pi);
  const double v = (lid ? p.y : p.z) / 0.105;
  const double row = std::floor(v);
  const double x = fraction(u + 0.5 * row) - 0.5;
  const double y = fraction(v) - 0.5;
  const double spot = 1 - smooth_step(0.26, 0.33, std::hypot(x, y));
  return mix(yellow, brown, spot) * (0.82 + 0.25 * noise(p * 26.0, 2));
}

Vec3d purple_wedges(Vec3d p) {
  static const Vec3d plum = web_color(0x63347f);
  static const Vec3d lilac = web_color(0xb992cf);
  const double around = std::atan2(p.y, p.x) * 9 / (2 * std::numbers::pi);
  return mix(plum, lilac, bands(around, 0.5, 0.03)) * (0.8 + 0.35 * noise(p * 25.0, 2));
}

Vec3d orange_peel(Vec3d p) {
  static const Vec3d orange = web_color(0xe07b26);
  static const Vec3d rust = web_color(0xa24a14);
  const double rings = bands(p.z * 9, 0.3, 0.05);
  return mix(orange, rust, std::clamp(0.7 * rings + 0.9 * smooth_step(0.5, 0.75, noise(p * 28.0, 2)), 0.0, 1.0));
}

Vec3d teal_bricks(Vec3d p) {
  static const Vec3d teal = web_color(0x2b837d);
  static const Vec3d joint = web_color(0xb9d2c8);
  const double v = p.z / 0.07 + 0.5;
  const double row = std::floor(v);
  const double u = (p.x + p.y) / 0.13 + 0.5 * row;
  const double brick = bands(v, 0.84, 0.03) * bands(u, 0.9, 0.02);
  const double tone = 0.65 + 0.6 * lattice(std::int64_t(std::floor(u)), std::int64_t(row), 11);
  return mix(joint, teal * tone, brick);
}

Vec3d pebble(Vec3d p) {
  const double stone = noise(p * 30.0, 3);
  const double grey = 0.12 + 0.55 * smooth_step(0.25, 0.8, stone);
  return {grey, grey, grey};
}

Vec3d pink_swirl(Vec3d p) {
  static const Vec3d rose = web_color(0xc4496c);
  static const Vec3d pale = web_color(0xeec3c9);
  const double twist = std::atan2(p.y, p.x) * 4 / (2 * std::numbers::pi) + 6 * p.z;
  return mix(rose, pale, bands(twist, 0.5, 0.05)) * (0.8 + 0.3 * noise(p * 30.0, 2));
}

}  // namespace cnerf::sample

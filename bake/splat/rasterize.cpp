#include "bake/splat/rasterize.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "src/base/check.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

constexpr std::size_t kGrain = 4096;  // splats of a parallel piece of work

/// The order of keys, equal ones as they come: a radix sort, which is several times as fast as a comparing one.
std::vector<std::uint32_t> sorted_order(const std::vector<std::uint32_t>& keys) {
  constexpr int kBits = 11, kBins = 1 << kBits;
  std::vector<std::uint32_t> order(keys.size()), next(keys.size());
  std::iota(order.begin(), order.end(), 0u);
  for (int shift = 0; shift < 32; shift += kBits) {
    std::vector<std::uint32_t> begins(kBins + 1, 0);
    for (const std::uint32_t key : keys) ++begins[(key >> shift & (kBins - 1)) + 1];
    std::partial_sum(begins.begin(), begins.end(), begins.begin());
    for (const std::uint32_t i : order) next[begins[keys[i] >> shift & (kBins - 1)]++] = i;
    order.swap(next);
  }
  return order;
}

/// A splat of a picture.
TileSplat tile_splat(const SplatProjection<float>& projection) {
  const FlatSplat<float>& flat = projection.flat();
  const float power = least_power(flat.opacity);
  const float reach = std::sqrt(std::max(0.0f, -2 * power));
  return {flat.x,
          flat.y,
          flat.a,
          flat.b,
          flat.c,
          flat.opacity,
          power,
          reach * std::sqrt(projection.variance_x()),
          reach * std::sqrt(projection.variance_y()),
          {flat.color.x, flat.color.y, flat.color.z}};
}

/// The tile that holds a pixel position, as far as there are tiles.
int tile_at(float position, int tiles) {
  return int(std::clamp(std::floor(position / kTileSide), 0.0f, float(tiles - 1)));
}

}  // namespace

void SplatRasterizer::place(std::span<const Splat> splats, const SplatCamera<float>& camera) {
  std::vector<std::vector<Placed>> parts((splats.size() + kGrain - 1) / kGrain);
  parallel_ranges(splats.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<Placed>& part = parts[begin / kGrain];
    for (std::size_t i = begin; i < end; ++i) {
      const auto projection = SplatProjection<float>::of(splats[i], camera);
      if (!projection || projection->flat().opacity < float(kLeastAlpha)) continue;
      const TileSplat flat = tile_splat(*projection);
      const float left = flat.x - flat.reach_x, right = flat.x + flat.reach_x;
      const float top = flat.y - flat.reach_y, bottom = flat.y + flat.reach_y;
      if (!(right > 0 && bottom > 0 && left < float(camera.width) && top < float(camera.height))) continue;
      part.push_back({std::uint32_t(i), projection->depth(), flat, tile_at(left, columns_), tile_at(top, rows_),
                      tile_at(right, columns_), tile_at(bottom, rows_), 0});
    }
  });
  unsorted_.clear();
  for (const auto& part : parts) unsorted_.insert(unsorted_.end(), part.begin(), part.end());
}

void SplatRasterizer::sort_by_depth() {
  std::vector<std::uint32_t> keys;
  keys.reserve(unsorted_.size());
  for (const Placed& placed : unsorted_) keys.push_back(std::bit_cast<std::uint32_t>(placed.depth));  // they are > 0
  const std::vector<std::uint32_t> order = sorted_order(keys);
  placed_.resize(order.size());
  flats_.resize(order.size());
  parallel_ranges(order.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      placed_[i] = unsorted_[order[i]];
      flats_[i] = placed_[i].flat;
    }
  });
}

void SplatRasterizer::list_tiles() {
  const std::size_t tiles = std::size_t(columns_) * std::size_t(rows_);
  std::vector<std::uint32_t> ends(tiles + 1, 0);
  std::uint32_t places = 0;
  for (Placed& placed : placed_) {
    placed.first_place = places;
    places += placed.tiles();
    for (int row = placed.top; row <= placed.bottom; ++row) {
      for (int column = placed.left; column <= placed.right; ++column) ++ends[std::size_t(row * columns_ + column) + 1];
    }
  }
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  lists_.resize(places);
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    const Placed& placed = placed_[i];
    std::uint32_t at = placed.first_place;
    for (int row = placed.top; row <= placed.bottom; ++row) {
      for (int column = placed.left; column <= placed.right; ++column) {
        lists_[ends[std::size_t(row * columns_ + column)]++] = {std::uint32_t(i), at++};
      }
    }
  }
  ends.pop_back();  // each list's begin became its end
  list_ends_ = std::move(ends);
}

const SplatPicture& SplatRasterizer::draw(std::span<const Splat> splats, const SplatCamera<float>& camera) {
  CNERF_CHECK(camera.width > 0 && camera.height > 0, "a picture of splats needs pixels");
  columns_ = (camera.width + kTileSide - 1) / kTileSide;
  rows_ = (camera.height + kTileSide - 1) / kTileSide;
  place(splats, camera);
  sort_by_depth();
  list_tiles();
  tiles_.resize(list_ends_.size());
  picture_.width = camera.width;
  picture_.height = camera.height;
  picture_.rgb.resize(3 * std::size_t(camera.width) * std::size_t(camera.height));
  picture_.opacity.resize(picture_.rgb.size() / 3);
  const TileKernels& kernels = tile_kernels();
  parallel_tasks(tiles_.size(), [&](std::size_t t) {
    const std::uint32_t begin = t == 0 ? 0 : list_ends_[t - 1];
    const int left = int(t) % columns_ * kTileSide, top = int(t) / columns_ * kTileSide;
    TilePixels& tile = tiles_[t];
    kernels.draw(flats_.data(), lists_.data() + begin, list_ends_[t] - begin, left, top, tile);
    for (int y = top; y < std::min(top + kTileSide, camera.height); ++y) {
      for (int x = left; x < std::min(left + kTileSide, camera.width); ++x) {
        const std::size_t to = std::size_t(y) * std::size_t(camera.width) + std::size_t(x);
        const int from = (y - top) * kTileSide + x - left;
        for (std::size_t c = 0; c < 3; ++c) picture_.rgb[3 * to + c] = tile.rgb[c][from];
        picture_.opacity[to] = 1 - tile.transmittance[from];
      }
    }
  });
  return picture_;
}

const SplatGradients& SplatRasterizer::gradient(std::span<const Splat> splats, const SplatCamera<float>& camera,
                                                const SplatPicture& d) {
  CNERF_CHECK(d.width == picture_.width && d.height == picture_.height, "the gradient is of another picture");
  sums_.resize(lists_.size());
  const TileKernels& kernels = tile_kernels();
  parallel_tasks(tiles_.size(), [&](std::size_t t) {
    const std::uint32_t begin = t == 0 ? 0 : list_ends_[t - 1];
    const int left = int(t) % columns_ * kTileSide, top = int(t) / columns_ * kTileSide;
    TilePixels by_tile{};
    for (int y = top; y < std::min(top + kTileSide, d.height); ++y) {
      for (int x = left; x < std::min(left + kTileSide, d.width); ++x) {
        const std::size_t from = std::size_t(y) * std::size_t(d.width) + std::size_t(x);
        const int to = (y - top) * kTileSide + x - left;
        for (std::size_t c = 0; c < 3; ++c) by_tile.rgb[c][to] = d.rgb[3 * from + c];
        by_tile.transmittance[to] = -d.opacity[from];
      }
    }
    kernels.gradient(flats_.data(), lists_.data() + begin, list_ends_[t] - begin, left, top, tiles_[t], by_tile,
                     sums_.data());
  });
  gradients_.splats.resize(placed_.size());
  gradients_.gradients.resize(placed_.size());
  gradients_.weights.resize(placed_.size());
  parallel_ranges(placed_.size(), kGrain / 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      gradients_.splats[i] = placed_[i].splat;
      gradients_.gradients[i] = splat_gradient(splats[placed_[i].splat], camera, placed_[i], gradients_.weights[i]);
    }
  });
  return gradients_;
}

Splat SplatRasterizer::splat_gradient(const Splat& splat, const SplatCamera<float>& camera, const Placed& placed,
                                      float& weight) const {
  TileSums total{};
  for (std::uint32_t i = 0; i < placed.tiles(); ++i) {
    const TileSums& of_tile = sums_[placed.first_place + i];
    total.p += of_tile.p;
    total.px += of_tile.px;
    total.py += of_tile.py;
    total.pxx += of_tile.pxx;
    total.pxy += of_tile.pxy;
    total.pyy += of_tile.pyy;
    for (int c = 0; c < 3; ++c) total.color[c] += of_tile.color[c];
    total.weight += of_tile.weight;
  }
  weight = total.weight;
  const TileSplat& flat = placed.flat;
  FlatSplat<float> d;
  d.x = flat.a * total.px + flat.b * total.py;
  d.y = flat.c * total.py + flat.b * total.px;
  d.a = -total.pxx / 2;
  d.b = -total.pxy;
  d.c = -total.pyy / 2;
  d.opacity = total.p / flat.opacity;
  d.color = {total.color[0], total.color[1], total.color[2]};
  const auto projection = SplatProjection<float>::of(splat, camera);
  return projection ? projection->gradient(d) : Splat{};
}

}  // namespace cnerf::bake

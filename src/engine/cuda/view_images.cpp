#include "src/engine/cuda/view_images.h"

namespace cnerf {
namespace {

const char* const kImageAdvice = "the training images; lower image_memory or raise capture.downscale";

bool is_evened(const MonoImage& image) {
  return image.exposure == 1 && image.haze == 0;
}

std::size_t pixel_bytes(const std::vector<TrainingView>& views) {
  std::size_t bytes = 0;
  for (const TrainingView& view : views) bytes += pixel_bytes(view);
  return bytes;
}

}  // namespace

std::size_t pixel_bytes(const TrainingView& view) {
  const MonoImage& image = *view.image;
  return bytes_of(image) + (view.sky_labels == nullptr ? 0 : view.sky_labels->size());
}

void place_pixels(const TrainingView& view, const PlacePlane& place, PlacedView& placed) {
  const MonoImage& image = *view.image;
  if (image.depth == PixelDepth::kU8) {
    placed.pixels = place(image.u8.data(), image.u8.size());
  } else if (image.depth == PixelDepth::kU16) {
    placed.pixels = place(image.u16.data(), image.u16.size() * sizeof(std::uint16_t));
  } else if (is_evened(image)) {
    placed.pixels = place(image.f32.data(), image.f32.size() * sizeof(float));
  } else {
    std::vector<float> values(image.f32.begin(), image.f32.end());
    for (float& value : values) value = image.evened(value);
    placed.pixels = place(values.data(), values.size() * sizeof(float));
  }
  placed.alpha = place(image.alpha.data(), image.alpha.size());
  placed.mask = place(image.mask.data(), image.mask.size());
  if (view.sky_labels != nullptr) {
    placed.sky_labels = reinterpret_cast<const SkyLabel*>(place(view.sky_labels->data(), view.sky_labels->size()));
  }
}

ViewImages::ViewImages(const std::vector<TrainingView>& views, std::size_t memory) {
  const bool all_fit = pixel_bytes(views) <= memory;
  std::vector<ViewRecord> records;
  for (const TrainingView& view : views) records.push_back(record_of(view, all_fit));
  records_ = uploaded(records, kImageAdvice);
  if (!all_fit) rotation_ = std::make_unique<ViewRotation>(views, memory, records_.data());
}

ViewRecord ViewImages::record_of(const TrainingView& view, bool with_pixels) {
  const MonoImage& image = *view.image;
  ViewRecord record;
  record.camera = view.camera;
  record.width = image.width;
  record.height = image.height;
  record.depth = image.depth;
  record.given = view.camera.intrinsics;
  record.lens = view.lens;
  if (image.depth != PixelDepth::kF32) record.decoded = decoded(image);
  if (view.sky_labels != nullptr) record.sky = sky(*view.sky);
  if (view.depths != nullptr) {
    const std::vector<DepthHint>& cells = view.depths->cells;
    record.depths = reinterpret_cast<const DepthHint*>(plane(cells.data(), cells.size() * sizeof(DepthHint)));
    record.depth_columns = view.depths->columns;
    record.depth_rows = view.depths->rows;
  }
  if (!with_pixels) return record;
  PlacedView placed;
  place_pixels(
      view, [this](const void* data, std::size_t bytes) { return plane(data, bytes); }, placed);
  record.pixels = placed.pixels;
  record.alpha = placed.alpha;
  record.mask = placed.mask;
  record.sky_labels = placed.sky_labels;
  return record;
}

const std::uint8_t* ViewImages::plane(const void* data, std::size_t bytes) {
  if (bytes == 0) return nullptr;
  planes_.emplace_back(bytes, kImageAdvice);
  planes_.back().upload(static_cast<const std::uint8_t*>(data), bytes);
  return planes_.back().data();
}

DirectionView ViewImages::sky(const DirectionMap& map) {
  if (uploaded_sky_ != &map) {
    uploaded_sky_ = &map;
    tables_.push_back(uploaded(map.planes[0], kImageAdvice));
    sky_ = {tables_.back().data(), map.width, map.height};
  }
  return sky_;
}

const float* ViewImages::decoded(const MonoImage& image) {
  const bool is_deep = image.depth == PixelDepth::kU16;
  const float* own = nullptr;
  const float*& table = is_evened(image) ? shared_tables_[is_deep][int(image.transfer)] : own;
  if (table != nullptr) return table;
  std::vector<float> values(is_deep ? 65536 : 256);
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = image.evened(decode_transfer(image.transfer, float(i) / float(values.size() - 1)));
  }
  tables_.push_back(uploaded(values, kImageAdvice));
  table = tables_.back().data();
  return table;
}

}  // namespace cnerf

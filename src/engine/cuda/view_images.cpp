#include "src/engine/cuda/view_images.h"

namespace cnerf {
namespace {

const char* const kImageAdvice = "the training images; raise capture.downscale";

bool is_evened(const MonoImage& image) {
  return image.exposure == 1 && image.haze == 0;
}

}  // namespace

ViewImages::ViewImages(const std::vector<TrainingView>& views) {
  std::vector<ViewRecord> records;
  for (const TrainingView& view : views) records.push_back(record_of(view));
  records_ = uploaded(records, kImageAdvice);
}

ViewRecord ViewImages::record_of(const TrainingView& view) {
  const MonoImage& image = *view.image;
  ViewRecord record;
  record.camera = view.camera;
  record.width = image.width;
  record.height = image.height;
  record.depth = image.depth;
  record.given = view.camera.intrinsics;
  record.lens = view.lens;
  if (image.depth == PixelDepth::kU8) {
    record.pixels = plane(image.u8.data(), image.u8.size());
    record.decoded = decoded(image);
  } else if (image.depth == PixelDepth::kU16) {
    record.pixels = plane(image.u16.data(), image.u16.size() * sizeof(std::uint16_t));
    record.decoded = decoded(image);
  } else if (is_evened(image)) {
    record.pixels = plane(image.f32.data(), image.f32.size() * sizeof(float));
  } else {
    std::vector<float> values = image.f32;
    for (float& value : values) value = image.evened(value);
    record.pixels = plane(values.data(), values.size() * sizeof(float));
  }
  record.alpha = plane(image.alpha.data(), image.alpha.size());
  record.mask = plane(image.mask.data(), image.mask.size());
  if (view.sky_labels != nullptr) {
    record.sky_labels = reinterpret_cast<const SkyLabel*>(plane(view.sky_labels->data(), view.sky_labels->size()));
    record.sky = sky(*view.sky);
  }
  if (view.depths != nullptr) {
    const std::vector<DepthHint>& cells = view.depths->cells;
    record.depths = reinterpret_cast<const DepthHint*>(plane(cells.data(), cells.size() * sizeof(DepthHint)));
    record.depth_columns = view.depths->columns;
    record.depth_rows = view.depths->rows;
  }
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

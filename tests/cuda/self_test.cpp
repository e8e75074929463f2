// Every kernel against the CPU's code on random input. A bound is stated where it is used; weights and activations are
// rounded to 16 bits on the GPU (half: 5e-4 relative, bfloat16 in the backward pass: 4e-3), sums are floats but for the
// eight corners of a hash grid's cell.

#include <cuda_runtime_api.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "encoding/cpu/hash_grid_kernels.h"
#include "encoding/cuda/hash_grid_cuda.h"
#include "encoding/hash_grid_reference.h"
#include "src/base/aligned.h"
#include "src/base/rng.h"
#include "src/engine/cpu/luminance_engine_cpu.h"
#include "src/engine/cuda/luminance_engine_cuda.h"
#include "src/engine/cuda/step_kernels.h"
#include "src/optim/cuda/row_adam_cuda.h"
#include "src/optim/row_adam.h"
#include "tests/cuda/check.h"
#include "tests/cuda/expect.h"
#include "tests/support/toy_capture.h"

namespace cnerf::test {
namespace {

int failure_count = 0;

std::uint16_t half_of(float value) {
  // Round to nearest even by way of the exponent's unit in the last place; the values here are normal or tiny.
  const float magnitude = std::abs(value);
  if (magnitude == 0) return 0;
  const int exponent = std::max(std::ilogb(magnitude), -14);
  const float rounded = std::nearbyint(std::ldexp(magnitude, 10 - exponent));
  const auto code = std::uint16_t(int(rounded) + ((exponent + 14) << 10));
  return std::uint16_t(code | (value < 0 ? 0x8000 : 0));
}
float float_of_half(std::uint16_t half) {
  const int exponent = (half >> 10) & 31, mantissa = half & 1023;
  const float magnitude =
      exponent == 0 ? std::ldexp(float(mantissa), -24) : std::ldexp(float(mantissa + 1024), exponent - 25);
  return (half & 0x8000) != 0 ? -magnitude : magnitude;
}
float float_of_bfloat(std::uint16_t bits) {
  const std::uint32_t word = std::uint32_t(bits) << 16;
  float value = 0;
  std::memcpy(&value, &word, sizeof(value));
  return value;
}
std::uint16_t bfloat_of(float value) {
  std::uint32_t word = 0;
  std::memcpy(&word, &value, sizeof(value));
  return std::uint16_t((word + 0x7fff + ((word >> 16) & 1)) >> 16);
}

/// Points along random rays through the unit cube, as a step has them.
std::vector<float> ray_points(std::size_t count, float spacing) {
  SequentialRng rng(5, 1);
  std::vector<float> places;
  while (places.size() < 4 * count) {
    Vec3f p = {rng.uniform(), rng.uniform(), rng.uniform()};
    Vec3f d = normalized(Vec3f{rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)});
    for (int i = 0; i < 40 && places.size() < 4 * count; ++i) {
      for (int axis = 0; axis < 3; ++axis) places.push_back(std::clamp(p[axis], 0.0f, 1.0f));
      places.push_back(0.0f);
      p += d * spacing;
    }
  }
  return places;
}

void check_hash_grid(int levels, int log2_rows) {
  HashGridOptions options;
  options.levels = levels;
  options.log2_rows = log2_rows;
  const std::vector<GridLevel> layout = hash_grid_levels(options);
  const std::uint32_t count = 20011, capacity = 20480;
  const std::vector<float> places = ray_points(count, 1.0f / 300);
  std::vector<float> positions, table;
  for (std::size_t i = 0; i < count; ++i) positions.insert(positions.end(), &places[4 * i], &places[4 * i] + 3);
  SequentialRng rng(7, 2);
  std::vector<std::uint16_t> halves;
  for (std::size_t i = 0; i < std::size_t(total_rows(layout)) * 4; ++i) {
    halves.push_back(half_of(rng.uniform(-1, 1)));
    table.push_back(float_of_half(halves.back()));
  }
  const auto d_table = uploaded(halves, "test");
  DeviceBuffer<float> d_places(std::size_t(capacity) * 4, "test");
  d_places.upload(places.data(), places.size());
  const auto d_count = uploaded(std::vector<std::uint32_t>{count}, "test");
  DeviceBuffer<std::uint16_t> encoded(std::size_t(capacity) * 4 * std::size_t(levels), "test");
  encode_cuda(layout, d_table.data(), d_places.data(), {d_count.data(), capacity}, encoded.data(), nullptr);
  CNERF_CUDA(cudaDeviceSynchronize());
  const std::vector<float> reference = encode_reference(layout, table, positions);
  std::vector<float> seen;
  for (const std::uint16_t h : encoded.downloaded()) seen.push_back(float_of_half(h));
  expect_below("hash grid forward", relative_distance(seen, reference), 2e-3);

  std::vector<double> d_encoded(std::size_t(count) * 4 * std::size_t(levels));
  std::vector<std::uint16_t> d_bfloat(std::size_t(capacity) * 4 * std::size_t(levels), 0);
  for (std::size_t i = 0; i < count; ++i) {
    for (int l = 0; l < levels; ++l) {
      for (int f = 0; f < 4; ++f) {
        const std::uint16_t d = bfloat_of(rng.uniform(-1, 1));
        d_bfloat[(std::size_t(l) * capacity + i) * 4 + std::size_t(f)] = d;
        d_encoded[(i * std::size_t(levels) + std::size_t(l)) * 4 + std::size_t(f)] = float_of_bfloat(d);
      }
    }
  }
  const auto d_gradient = uploaded(d_bfloat, "test");
  DeviceBuffer<float> gradient(table.size(), "test");
  encode_backward_cuda(layout, d_places.data(), {d_count.data(), capacity}, d_gradient.data(), gradient.data(),
                       nullptr);
  CNERF_CUDA(cudaDeviceSynchronize());
  // Positions as floats on both sides: cells and weights are then the same but for the last bit.
  std::vector<double> exact_positions(positions.begin(), positions.end());
  const std::vector<float> d_float(d_encoded.begin(), d_encoded.end());
  const std::vector<float> expected = encode_backward_reference(layout, positions, d_float);
  expect_gradient("hash grid backward", gradient.downloaded(), expected, 1e-5);
}

/// Adam and decay on rows with and without a gradient, against the processor's kernel.
void check_table_update() {
  constexpr std::uint32_t kRows = 4099;
  constexpr float kDecay = 30;  // a step then takes 30 % of a row: no rounding hides a missing decay
  const AdamStep step(1e-2f, 5);
  SequentialRng rng(13, 1);
  AlignedVector<float> table, gradient, moments;
  for (std::uint32_t row = 0; row < kRows; ++row) {
    for (int f = 0; f < 4; ++f) {
      table.push_back(rng.uniform(-1, 1));
      gradient.push_back(row % 3 == 0 ? 0.0f : rng.uniform(-1, 1));
      moments.push_back(rng.uniform(-1, 1));
    }
    for (int f = 0; f < 4; ++f) moments.push_back(rng.uniform(0.1f, 1));
  }
  const auto on_device = [](const AlignedVector<float>& v) {
    return uploaded(std::vector(v.begin(), v.end()), "test");
  };
  const auto d_table = on_device(table), d_gradient = on_device(gradient), d_moments = on_device(moments);
  DeviceBuffer<std::uint16_t> halves(table.size(), "test");
  const auto d_step = uploaded(std::vector<AdamStep>{step}, "test");
  update_rows({reinterpret_cast<float4*>(d_table.data()), reinterpret_cast<float4*>(d_gradient.data()),
               reinterpret_cast<float4*>(d_moments.data()), reinterpret_cast<uint2*>(halves.data()), kRows},
              d_step.data(), kDecay, nullptr);
  CNERF_CUDA(cudaDeviceSynchronize());
  update_rows({table.data(), gradient.data(), moments.data(), kRows}, step, kDecay);
  expect_below("table after Adam and decay", relative_distance(d_table.downloaded(), table), 1e-5);
  expect_below("its moments", relative_distance(d_moments.downloaded(), moments), 1e-5);
}

struct Problem {
  const char* name;
  int levels, log2_rows, finest, cascades, patch;
  bool with_alpha, with_lens, with_exposures = false;
  float distortion_weight = 0;
};

void check_engine(const Problem& problem) {
  std::printf("-- %s: %d levels, 2^%d rows, %d cascades\n", problem.name, problem.levels, problem.log2_rows,
              problem.cascades);
  Capture capture = toy_capture(6, 48, 40, problem.with_alpha);
  if (problem.with_lens) {
    for (View& view : capture.views) {
      view.intrinsics.model = LensModel::kOpenCv;
      view.intrinsics.distortion = {-0.1, 0.02, 1e-3, -2e-3, 0, 0, 0, 0};
      view.image.mask.assign(view.image.pixel_count(), 255);
      for (std::size_t i = 0; i < view.image.mask.size(); i += 3) view.image.mask[i] = 0;
    }
  }
  if (problem.with_exposures) {
    for (std::size_t v = 0; v < capture.views.size(); ++v)
      capture.views[v].image.exposure = 0.7f + 0.15f * float(v % 5);
  }
  SceneFrame frame;
  frame.unit_per_world = problem.cascades > 1 ? 0.12 : 0.4;
  frame.cascades = problem.cascades;
  const std::vector<TrainingView> views = training_views(capture, frame);
  LuminanceEngineOptions options;
  options.grid.levels = problem.levels;
  options.grid.log2_rows = problem.log2_rows;
  options.grid.coarsest_resolution = 4;
  options.grid.finest_resolution = problem.finest;
  options.occupancy.resolution = 32;
  options.cascades = problem.cascades;
  options.march = march_settings(problem.cascades, 64, 1.0 / 64);
  options.samples_per_step = 16384;
  options.patch_size = problem.patch;
  options.distortion_weight = problem.distortion_weight;
  LuminanceEngineCpu cpu(options);
  LuminanceEngineCuda cuda(options);
  for (int i = 0; i < 40; ++i) cpu.step(views, 1e-2f);
  copy_state<LuminanceEngine>(cpu, cuda);

  const LuminanceEngineCpu::Gradients expected = cpu.gradients(views);
  const CudaGradients found = cuda.gradients(views);
  expect_below("rays", std::abs(double(found.report.rays) - double(expected.report.rays)), 0.5);
  // Lattice points on the face of a cell may fall on either side; a ray may end one sample earlier.
  const auto off = [](std::size_t a, std::size_t b) { return std::abs(double(a) - double(b)) / double(b); };
  expect_below("trained samples", off(found.report.trained_samples, expected.report.trained_samples), 5e-3);
  expect_below("loss", std::abs(found.report.loss - expected.report.loss) / expected.report.loss, 5e-3);
  expect_below("squared error",
               std::abs(found.report.squared_error - expected.report.squared_error) / expected.report.squared_error,
               5e-3);
  expect_below("gradient of the table", relative_distance(found.table, expected.table), 3e-2);
  expect_gradient("gradient of the nets", found.weights, expected.weights, 3e-2);

  SequentialRng rng(11, 3);
  std::vector<Vec3f> points, directions;
  for (int i = 0; i < 5003; ++i) {
    points.push_back({rng.uniform(), rng.uniform(), rng.uniform()});
    directions.push_back(normalized(Vec3f{rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)}));
  }
  std::vector<float> a(points.size()), b(points.size());
  cpu.query_density(points, b);
  cuda.query_density(points, a);
  expect_below("density of points", relative_distance(a, b), 1e-2);
  cpu.query_luminance(points, directions, b);
  cuda.query_luminance(points, directions, a);
  expect_below("luminance of points", relative_distance(a, b), 5e-3);

  std::vector<Ray> rays;
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 48; ++x) rays.push_back(views[1].camera.ray({x + 0.5, y + 0.5}));
  }
  std::vector<RayResult> rendered(rays.size()), seen(rays.size()), of_view(rays.size());
  cpu.render(rays, options.march, {}, rendered);
  cuda.render(rays, options.march, {}, seen);
  cuda.render_view(views[1].camera, options.march, RenderEffort{}.min_transmittance, of_view);
  std::vector<double> luminance[3], opacity[2], depth[2];
  for (std::size_t r = 0; r < rays.size(); ++r) {
    luminance[0].push_back(seen[r].luminance), luminance[1].push_back(rendered[r].luminance);
    luminance[2].push_back(of_view[r].luminance);
    opacity[0].push_back(seen[r].opacity), opacity[1].push_back(rendered[r].opacity);
    depth[0].push_back(seen[r].depth * seen[r].opacity), depth[1].push_back(rendered[r].depth * rendered[r].opacity);
  }
  expect_below("rendered luminance", relative_distance(luminance[0], luminance[1]), 1e-2);
  expect_below("rendered opacity", relative_distance(opacity[0], opacity[1]), 1e-2);
  expect_below("rendered depth", relative_distance(depth[0], depth[1]), 1e-2);
  expect_below("view against rays", relative_distance(luminance[2], luminance[0]), 1e-5);

  std::vector<WeightedSample> samples;
  std::vector<std::size_t> offsets;
  cuda.trace(rays, options.march, {}, samples, offsets);
  std::vector<double> traced(rays.size(), 0.0);
  bool in_order = offsets.size() == rays.size() + 1 && offsets.back() == samples.size();
  for (std::size_t r = 0; in_order && r < rays.size(); ++r) {
    for (std::size_t s = offsets[r]; s < offsets[r + 1]; ++s) {
      traced[r] += double(samples[s].weight) * samples[s].luminance;
      if (s > offsets[r]) in_order = in_order && samples[s].t > samples[s - 1].t;
    }
  }
  expect(in_order, "traced samples in order", 0, 0);
  expect_below("traced luminance", relative_distance(traced, luminance[0]), 1e-4);

  // A step: the occupancy's look, then Adam. Where gradients are mostly noise, Adam's step has either sign.
  copy_state<LuminanceEngine>(cpu, cuda);
  while (cpu.step_count() % 16 != 0) cpu.step(views, 1e-3f);
  copy_state<LuminanceEngine>(cpu, cuda);
  cpu.step(views, 1e-3f);
  cuda.step(views, 1e-3f);
  cuda.finish();
  const std::vector<StatePiece> of_cpu = cpu.state(), of_cuda = cuda.state();
  for (std::size_t i = 0; i < of_cpu.size(); ++i) {
    if (of_cpu[i].name == "counters") continue;
    const bool is_second = of_cpu[i].name.find("moments") != std::string::npos;
    expect_below("after a step: " + of_cpu[i].name, relative_distance(floats_of(of_cuda[i]), floats_of(of_cpu[i])),
                 is_second ? 3e-2 : 1e-2);
  }

  // Rounding sends the two apart. Averaged, since a step's loss depends mostly on the pixels it drew.
  const auto trained_loss = [&](LuminanceEngine& engine) {
    for (int i = 0; i < 250; ++i) engine.step(views, 1e-2f);
    double sum = 0;
    for (int i = 0; i < 50; ++i) sum += engine.step(views, 1e-2f).loss;
    return sum / 50;
  };
  LuminanceEngineCuda fresh(options);
  const double first = fresh.step(views, 1e-2f).loss, last = trained_loss(fresh);
  LuminanceEngineCpu same(options);
  same.step(views, 1e-2f);
  expect_below("loss after 300 steps / first loss", last / first, 0.5);
  expect_below("loss after 300 steps / the CPU's", last / trained_loss(same), 1.6);
}

void check_errors() {
  std::string message;
  try {
    const DeviceBuffer<float> huge(std::size_t(1) << 42, "the hash grid; lower stage1.grid.log2_rows");
  } catch (const DeviceError& failure) {
    message = failure.what();
  }
  std::printf("      %s\n", message.c_str());
  expect(message.find("lower stage1.grid.log2_rows") != std::string::npos, "out of memory says what to lower", 0, 0);
}

}  // namespace

void expect(bool holds, const std::string& what, double value, double bound) {
  std::printf("%s  %-58s %10.3e  (bound %.1e)\n", holds ? "ok  " : "FAIL", what.c_str(), value, bound);
  std::fflush(stdout);
  if (!holds) ++failure_count;
}
int failures() {
  return failure_count;
}
void expect_gradient(const std::string& what, const std::vector<float>& found, const std::vector<float>& expected,
                     double bound) {
  expect_below(what, relative_distance(found, expected), bound);
  std::vector<float> flipped = found;
  for (float& value : flipped) value = -value;
  const double distance = relative_distance(flipped, expected);
  expect(distance > 1.0, "  (a flipped one is noticed)", distance, 1.0);
}

int self_test(const Arguments& arguments) {
  const bool quick = arguments.number("quick", 0) != 0;
  check_chroma(quick);
  if (arguments.number("stage", 0) == 2) return failures();
  check_hash_grid(8, 15);
  check_hash_grid(3, 19);
  check_table_update();
  check_engine({"opaque, exposures", 8, 14, 64, 1, 0, false, false, true});
  check_engine({"distortion", 8, 14, 64, 2, 0, false, false, false, 0.3f});
  if (!quick) {
    check_engine({"alpha", 3, 12, 20, 1, 0, true, false});
    check_engine({"cascades, lens, mask", 12, 14, 128, 3, 0, false, true});
    check_engine({"patches", 16, 13, 128, 2, 8, false, false});
  }
  check_sights();
  check_errors();
  std::printf("%d failures\n", failures());
  return failures();
}

}  // namespace cnerf::test

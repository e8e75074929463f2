// Retouching: what is painted gets its colours, all else keeps those it has.

#include "src/train/chroma/retouch.h"

#include "src/train/chroma/color_model.h"
#include "src/train/luminance/luminance_model.h"
#include "tests/support/stage2_fixture.h"

namespace cnerf {
namespace {

using test::kAnswer;
using test::Listening;

class Retouching : public test::Stage2Fixture {
 protected:
  void SetUp() override {
    Stage2Fixture::SetUp();
    static const Trained trained = train();  // the same for all tests of a process
    write_file(take("a"), trained.take);
    cache_ = trained.cache;
    seen_.emplace(cache_.views(), cache_.names());
  }

  /// A take's snapshot, and the views that it was trained on.
  struct Trained {
    std::vector<std::byte> take;
    ViewCache cache;
  };
  [[nodiscard]] Trained train() {
    Trained trained;
    Listening colorizer;
    Stage2Options options = small_options();
    options.distill_steps = 40;
    (void)train_stage2({capture_, stage1(), options, colorizer, {}, take("a"), false, &trained.cache}, cpu_engines(),
                       observer_);
    trained.take = read_binary_file(take("a"));
    return trained;
  }

  /// The left third of a view.
  [[nodiscard]] KnownColors painted_third(Ab color) const {
    const CachedView& view = cache_.views()[0];
    KnownColors known{KnownColorKind::kStrokes, cache_.names()[0], view.width, view.height, {}, {}};
    known.ab.assign(view.opacity.size(), color);
    for (std::size_t p = 0; p < known.ab.size(); ++p) {
      known.is_known.push_back(int(p) % view.width < view.width / 3 ? 1 : 0);
    }
    known.reach.assign(known.ab.size(), 0.0f);
    return known;
  }

  /// Mean ab distance of the decoded and of the per-sample colours to what is wanted, over opaque pixels of the view.
  struct Distances {
    double decoded = 0, baked = 0;
  };
  [[nodiscard]] Distances distances(const ColorModel& model, const std::function<const Ab*(std::uint32_t)>& wanted) {
    std::vector<ViewPixel> places;
    std::vector<Ab> colors;
    const CachedView& view = cache_.views()[0];
    for (std::uint32_t p = 0; p < view.opacity.size(); ++p) {
      if (view.opacity[p] < 0.9f || view.luminance[p] < 0.1f || wanted(p) == nullptr) continue;
      places.push_back({0, p});
      colors.push_back(*wanted(p));
    }
    EXPECT_GT(places.size(), 50u);
    const PixelSamples pixels = pixel_samples(cache_.views(), places);
    const std::vector<Ab> decoded = model.decode(pixels);
    std::vector<Ab> baked(places.size());
    model.chromaticity->composite(pixels, baked);
    Distances sum;
    for (std::size_t i = 0; i < places.size(); ++i) {
      sum.decoded += std::hypot(decoded[i].a - colors[i].a, decoded[i].b - colors[i].b) / double(places.size());
      sum.baked += std::hypot(baked[i].a - colors[i].a, baked[i].b - colors[i].b) / double(places.size());
    }
    return sum;
  }

  ViewCache cache_;
  std::optional<SeenSurfaces> seen_;
};

TEST(RetouchLabels, DecodeToTheirColor) {
  double usual = 0, ours = 0;
  int count = 0;
  for (float a = -30; a <= 30; a += 3.7f) {
    for (float b = -30; b <= 30; b += 3.3f) {
      const auto miss = [&](const SoftLabel& label) {
        std::vector<float> logits(kAbBinCount, -60.0f);
        for (int i = 0; i < kSoftLabelBins; ++i) {
          logits[std::size_t(label.bin[std::size_t(i)])] = std::log(label.weight[std::size_t(i)]);
        }
        const Ab seen = decode_annealed_mean(logits, 0.6f);
        return std::hypot(seen.a - a, seen.b - b);
      };
      usual += miss(soft_label({a, b}));
      ours += miss(label_decoded_to({a, b}, 0.6f));
      ++count;
    }
  }
  EXPECT_GT(usual / count, 0.8) << "or there is nothing to mend";
  EXPECT_LT(ours / count, 0.35);
}

TEST_F(Retouching, PaintIsLearntAndAllElseStays) {
  const Ab paint = {-20, 25};
  const std::vector<KnownColors> known = {painted_third(paint)};
  const KnownColorMap map(*seen_, KnownColorSources(*seen_, known));
  ColorModel base = ColorModel::load(take("a"), cpu_engines());
  ColorModel now = base.copy(cpu_engines());
  Retouch retouch(cache_.views(), map, &base, now, {.steps = 100, .known_pixels = 192, .kept_pixels = 192});
  while (!retouch.is_settled()) retouch.step();
  EXPECT_EQ(retouch.steps_done(), 100);
  const Distances painted = distances(now, [&](std::uint32_t p) { return map.find(0, p); });
  EXPECT_LT(painted.decoded, 6) << "of " << std::hypot(paint.a - kAnswer.a, paint.b - kAnswer.b);
  EXPECT_LT(painted.baked, 8);
  const Distances kept =
      distances(now, [&](std::uint32_t p) { return map.find(0, p) == nullptr ? &kAnswer : nullptr; });
  EXPECT_LT(kept.decoded, 5);
  EXPECT_LT(kept.baked, 7);
}

TEST_F(Retouching, WithoutABaseWhatIsNotPaintedIsGrey) {
  const std::vector<KnownColors> known = {painted_third({30, 30})};
  const KnownColorMap map(*seen_, KnownColorSources(*seen_, known));
  ColorModel now = ColorModel::create(small_options(), cpu_engines());
  Retouch retouch(cache_.views(), map, nullptr, now, {.steps = 120, .known_pixels = 192, .kept_pixels = 192});
  while (!retouch.is_settled()) retouch.step();
  const Ab grey = {};
  const auto unpainted = [&](std::uint32_t p) { return map.find(0, p) == nullptr ? &grey : nullptr; };
  EXPECT_LT(distances(now, unpainted).decoded, 5);
  EXPECT_LT(distances(now, [&](std::uint32_t p) { return map.find(0, p); }).decoded, 8);
}

TEST_F(Retouching, StepsRepeatBitForBit) {
  const std::vector<KnownColors> known = {painted_third({30, 30})};
  const KnownColorMap map(*seen_, KnownColorSources(*seen_, known));
  ColorModel base = ColorModel::load(take("a"), cpu_engines());
  double losses[2] = {};
  for (double& loss : losses) {
    ColorModel now = base.copy(cpu_engines());
    Retouch retouch(cache_.views(), map, &base, now, {.steps = 6, .known_pixels = 128, .kept_pixels = 128});
    while (!retouch.is_settled()) loss = retouch.step();
  }
  EXPECT_EQ(losses[0], losses[1]) << "and the base was not touched";
}

}  // namespace
}  // namespace cnerf

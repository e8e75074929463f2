#pragma once
/// Other ways through stage 2: colours learnt as such instead of as a distribution, and views shown whole instead of
/// patches drawn afresh.

#include <string>
#include <vector>

#include "src/colorizer/colorizer.h"
#include "src/train/chroma/injection.h"
#include "src/train/chroma/questioner.h"

namespace cnerf::compare {

/// The mean squared ab distance of the composited per-sample colour, which is what pixels show; no distribution.
class Photometric final : public Injection {
 public:
  [[nodiscard]] PixelColors pixel_colors() const override { return PixelColors::kField; }
  [[nodiscard]] long step_count(const ColorModel& model) const override { return model.chromaticity->step_count(); }
  double step(ColorModel& model, const ColoredPixels& pixels, float learning_rate) const override;
};

/// Shows the colorizer each view whole and once, and answers about patches from that: colorize, then fuse. Views come
/// along the path of the cameras, so that a colorizer that remembers can carry colours on from one to the next. With
/// several sizes it is shown each view at each of them, and patches take these answers in turns.
class ViewQuestions final : public Questions {
 public:
  /// @param sizes  the view's own, at most two sides of a patch; half of it, a quarter of it, ...
  explicit ViewQuestions(int sizes = 1) : sizes_(std::size_t(sizes)) {}
  void prepare(Session& session) override;
  void answer(const Session& session, std::span<AnsweredPatch> patches) override;

 private:
  std::size_t sizes_;
  std::vector<std::vector<float>> answers_;  // [views, sizes] of [2, H, W]
};

/// A whole view as a question, its short side at most `short_side` pixels.
[[nodiscard]] LightnessBatch whole_view(const CachedView& view, const std::string& name, std::uint64_t query,
                                        int short_side);
/// The view that tells most of the others' colours (src/train/chroma/key_views.h), at its own size.
[[nodiscard]] LightnessBatch key_view(const ViewCache& views);
/// The answer to such a question at the view's own size, [2, H, W].
[[nodiscard]] std::vector<float> at_view_size(const CachedView& view, const LightnessBatch& question,
                                              const std::vector<float>& ab);
/// The views in an order in which one might walk past them: from the first one always to the nearest that is left.
[[nodiscard]] std::vector<std::size_t> along_the_path(std::span<const CachedView> views);

}  // namespace cnerf::compare

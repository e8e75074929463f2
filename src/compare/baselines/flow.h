#pragma once
/// A colorizer for views that come in the order of a path: colours of the view before are carried on by optical flow,
/// and the wrapped colorizer fills in what they do not reach. A stand-in for video colorization networks.

#include <memory>
#include <string>

#include "src/colorizer/colorizer.h"

namespace cnerf::compare {

/// Share of the carried colour where the flow can be trusted; the rest is the answer about the view itself, so that an
/// error of the first view fades.
inline constexpr float kCarriedShare = 0.8f;

/// Answers batches of one view each. Flow: Kroeger et al. 2016 (dense inverse search), both ways; it is trusted as far
/// as the two ways agree and the lightness matches. A view of another size starts afresh.
class FlowColorizer final : public Colorizer {
 public:
  explicit FlowColorizer(std::unique_ptr<Colorizer> inner);
  ~FlowColorizer() override;

  /// @throws ColorizerError  also for a batch of more than one.
  [[nodiscard]] ChromaBatch colorize(const LightnessBatch& view) override;
  [[nodiscard]] std::string name() const override { return "flow over " + inner_->name(); }

 private:
  struct Memory;
  std::unique_ptr<Colorizer> inner_;
  std::unique_ptr<Memory> memory_;
};

}  // namespace cnerf::compare

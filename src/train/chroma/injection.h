#pragma once
/// Injection: how answers of the colorizer become colours of the field.

#include <span>
#include <vector>

#include "src/colorizer/purify.h"
#include "src/train/chroma/color_model.h"
#include "src/train/chroma/galleries.h"
#include "src/train/chroma/known_color_map.h"
#include "src/train/chroma/questioner.h"

namespace cnerf {

/// Pixels with the colours that they should have.
struct ColoredPixels {
  PixelSamples samples;
  std::vector<Ab> colors;      ///< [R]
  std::vector<float> weights;  ///< [R] of their losses
};

/// What a step learns from. An extension point: the comparison has another one.
class Injection {
 public:
  virtual ~Injection() = default;
  /// Where a take's pixels have their colours from.
  [[nodiscard]] virtual PixelColors pixel_colors() const = 0;
  /// Steps that the model has had.
  [[nodiscard]] virtual long step_count(const ColorModel& model) const = 0;
  /// One optimiser step; returns the mean loss.
  virtual double step(ColorModel& model, const ColoredPixels& pixels, float learning_rate) const = 0;
};

/// Classification-based injection (paper, Eq. color classification loss): soft labels over the ab bins.
class Classification final : public Injection {
 public:
  explicit Classification(const Stage2Options& options)
      : weights_{float(options.spread_weight), float(options.regression_weight)} {}
  [[nodiscard]] PixelColors pixel_colors() const override { return PixelColors::kDistribution; }
  [[nodiscard]] long step_count(const ColorModel& model) const override { return model.chroma->step_count(); }
  double step(ColorModel& model, const ColoredPixels& pixels, float learning_rate) const override;

 private:
  ChromaLossWeights weights_;
};

/// Query-based colorization: draws, asks, purifies, and trains on what passes.
class PatchTraining {
 public:
  /// All are referred to.
  PatchTraining(Session& session, const Injection& injection, Questioner& questioner, const Purifier& purifier,
                const KnownColorMap& known);
  /// Until the model has had as many steps as there are patches in the options.
  void run();

 private:
  /// What a step learns from an answer.
  struct Lesson {
    const AnsweredPatch* patch = nullptr;
    bool is_accepted = false;
    long step = 0;  ///< its number
    ColoredPixels pixels;
  };

  [[nodiscard]] long steps() const;
  /// The colorizer answers about the next patches, while the model has the steps that it still has to do.
  void ask_ahead(long steps_to_do);
  /// Of the answers to one query, in their order, without pixels yet.
  [[nodiscard]] std::vector<Lesson> lessons_of(std::span<const AnsweredPatch> patches);
  /// @return  whether anything is to be learnt with it
  bool judge(const AnsweredPatch& patch, bool is_accepted);
  /// What an answer says of the sky.
  void learn_sky(const AnsweredPatch& patch);
  [[nodiscard]] ColoredPixels pixels_of(const Lesson& lesson) const;
  void add_known(long step, std::vector<ViewPixel>& places, std::vector<Ab>& colors) const;

  Session& session_;
  const Injection& injection_;
  Questioner& questioner_;
  const Purifier& purifier_;
  const KnownColorMap& known_;
  Galleries galleries_;
  int rejected_in_a_row_ = 0;
};

}  // namespace cnerf

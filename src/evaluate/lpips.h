#pragma once
/// LPIPS v0.1 (Zhang et al. 2018): how far two pictures are apart for a network trained on human judgements. Weights
/// are the user's to bring; the networks run in OpenCV.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

namespace cnerf {

/// Sum over layers of the spatial mean of weighted squared differences of channel-normalised features. AlexNet (what
/// papers report) or SqueezeNet 1.1, whichever the weights are of. Not for several threads.
class Lpips {
 public:
  static constexpr int kLeastSide = 32;  ///< pixels of a picture's shorter side

  /// @param weights  float32 tensors, little-endian; beside it a text with a line `name shape offset` a tensor, offsets
  ///                 in floats: `X_manifest.txt` for `X_f32.bin`, or `X.txt` for `X.bin`.
  /// @throws MissingInputError, InputError  naming the file and the tensor.
  explicit Lpips(const std::filesystem::path& weights);
  ~Lpips();
  Lpips(const Lpips&) = delete;
  Lpips& operator=(const Lpips&) = delete;

  [[nodiscard]] const std::string& network() const;  ///< "AlexNet" or "SqueezeNet"

  /// 0 for equal pictures.
  /// @param ours, truth  [H, W, 3] 8-bit sRGB, of kLeastSide or more
  [[nodiscard]] double distance(std::span<const std::uint8_t> ours, std::span<const std::uint8_t> truth, int width,
                                int height) const;

 private:
  struct Network;
  std::unique_ptr<Network> network_;
};

}  // namespace cnerf

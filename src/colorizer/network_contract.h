#pragma once
/// How a network that somebody trained wants to be asked, and what it answers: declared in a TOML file beside it.
/// Shared by the back ends that run such networks. docs/colorizers.md describes the file.

#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "src/colorizer/colorizer.h"

namespace cnerf {

struct NetworkContract {
  std::string input = "L100";  ///< L*: "L100" 0..100, "L01" 0..1, "L-50" -50..50, "L-1" -1..1, "rgb01" grey sRGB
  std::string output = "ab";   ///< "ab" Lab units, "ab1" ab / 110, "logits313", "rgb01" sRGB
  std::string layer;           ///< whose output is read, where the back end has names for layers; empty = the last
  int size = 0;                ///< patches are resized to this side; 0 = as they are
  int multiple_of = 1;         ///< else padded up to a multiple of this by repeating the border

  [[nodiscard]] int output_channels() const;
};

/// `network`.toml, or what holds without it.  @throws InputError  naming the key.
[[nodiscard]] NetworkContract contract_beside(const std::filesystem::path& network);

/// Lets a child of this process read a network before this one does: libraries trust the files that they read.
/// @param read     throws what a user is to be told
/// @param damaged  what a user is told where the child crashes, takes too long, or half a gigabyte and eight times the
///                 file's size
/// @throws ColorizerError
void read_in_child(const std::function<void()>& read, double seconds, const std::filesystem::path& file,
                   const std::string& damaged);

/// A float tensor [batch, channels, height, width].
struct Planes {
  int batch = 0, channels = 0, height = 0, width = 0;
  std::vector<float> values;

  [[nodiscard]] std::size_t plane_size() const { return std::size_t(height) * std::size_t(width); }
  [[nodiscard]] std::string shape_text() const;
};

/// The question in the network's own size and unit.
[[nodiscard]] Planes network_input(const NetworkContract& contract, const LightnessBatch& question);

/// The network's answer as the question's size and our units have it. An answer at another resolution than the input's
/// (say, logits at a quarter) is brought back to it; then the padding goes.
/// @param asked  what the network was given
/// @throws ColorizerError  naming `colorizer`, when the shape is not what the contract says.
[[nodiscard]] ChromaBatch chroma_of(const NetworkContract& contract, const Planes& raw, const Planes& asked,
                                    const LightnessBatch& question, const std::string& colorizer);

/// A colorizer that asks such a network; its back end says how the network is run.
class NetworkColorizer : public Colorizer {
 public:
  /// @param files  that the network is read from; the contract lies beside the last one
  NetworkColorizer(std::string name, const std::vector<std::filesystem::path>& files);

  ChromaBatch colorize(const LightnessBatch& patches) final {
    const Planes input = network_input(contract_, patches);
    return chroma_of(contract_, run(input), input, patches, name_);
  }
  /// With a hash of what the files hold: another network under their names is another colorizer.
  [[nodiscard]] std::string name() const final { return name_ + " (" + hash_ + ")"; }

 protected:
  /// @throws ColorizerError  naming the colorizer.
  [[nodiscard]] virtual Planes run(const Planes& input) = 0;

  std::string name_;  ///< as the user wrote it
  NetworkContract contract_;

 private:
  std::string hash_;
};

/// The first line of a library's message: the rest is its stack.
[[nodiscard]] std::string first_line(const std::string& text);

}  // namespace cnerf

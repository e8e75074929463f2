#pragma once
/// Weights of a network as named tensors in a file.

#include <cstddef>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace cnerf {

/// float32 tensors, little-endian; beside them a text with a line `name shape offset` a tensor, offsets in floats:
/// `X_manifest.txt` for `X_f32.bin`, or `X.txt` for `X.bin`.
class TensorFile {
 public:
  struct Tensor {
    std::vector<int> shape;
    std::span<const float> values;  ///< of the TensorFile
  };

  /// @throws MissingInputError, InputError  naming the file and the tensor.
  explicit TensorFile(const std::filesystem::path& weights);

  [[nodiscard]] bool has(const std::string& name) const { return tensors_.contains(name); }
  /// @throws InputError  when there is none of that name.
  [[nodiscard]] const Tensor& get(const std::string& name) const;

 private:
  void add(const std::string& line);

  std::filesystem::path file_, manifest_;
  std::vector<float> values_;
  std::map<std::string, Tensor> tensors_;
};

}  // namespace cnerf

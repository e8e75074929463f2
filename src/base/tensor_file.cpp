#include "src/base/tensor_file.h"

#include <cstring>
#include <sstream>

#include "src/base/error.h"
#include "src/base/files.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

fs::path manifest_of(const fs::path& weights) {
  std::string stem = weights.stem().string();
  if (stem.ends_with("_f32")) return weights.parent_path() / (stem.substr(0, stem.size() - 4) + "_manifest.txt");
  return weights.parent_path() / (stem + ".txt");
}

}  // namespace

TensorFile::TensorFile(const fs::path& weights) : file_(weights), manifest_(manifest_of(weights)) {
  const std::vector<std::byte> bytes = read_binary_file(weights);
  values_.resize(bytes.size() / sizeof(float));
  if (!values_.empty()) std::memcpy(values_.data(), bytes.data(), values_.size() * sizeof(float));
  std::istringstream lines(read_text_file(manifest_));
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty()) add(line);
  }
}

const TensorFile::Tensor& TensorFile::get(const std::string& name) const {
  const auto found = tensors_.find(name);
  if (found == tensors_.end()) throw InputError(manifest_, name, "no such tensor; is this another network?");
  return found->second;
}

void TensorFile::add(const std::string& line) {
  std::istringstream words(line);
  std::string name, shape;
  std::size_t offset = 0;
  if (!(words >> name >> shape >> offset)) {
    throw InputError(manifest_, line, "expected a name, a shape such as 64x3x3x3, and an offset");
  }
  Tensor tensor;
  std::size_t size = 1;
  std::istringstream sides(shape);
  for (std::string side; std::getline(sides, side, 'x');) {
    const bool is_number =
        !side.empty() && side.size() < 7 && side.find_first_not_of("0123456789") == std::string::npos;
    if (!is_number) throw InputError(manifest_, name, "expected a shape such as 64x3x3x3, got " + shape);
    tensor.shape.push_back(std::stoi(side));
    size *= std::size_t(tensor.shape.back());
  }
  if (size == 0 || offset > values_.size() || size > values_.size() - offset) {
    throw InputError(file_, name, "lies beyond the end of the file");
  }
  tensor.values = std::span(values_).subspan(offset, size);
  tensors_.emplace(name, std::move(tensor));
}

}  // namespace cnerf

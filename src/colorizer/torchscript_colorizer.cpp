// torchscript:FILE, a scripted LibTorch module; docs/colorizers.md describes FILE.toml.

#include <torch/script.h>
#include <torch/version.h>

#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <set>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/color/ab_bins.h"
#include "src/color/colorspace_math.h"
#include "src/colorizer/kinds.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;
using torch::Tensor;

/// How a module wants to be asked and what it answers.
struct ModuleContract {
  std::string input = "L100";  ///< L*: "L100" 0..100, "L01" 0..1, "L-50" -50..50, "L-1" -1..1, "rgb01" grey sRGB
  std::string output = "ab";   ///< "ab" Lab units, "ab1" ab / 110, "logits313", "rgb01" sRGB
  int size = 0;                ///< patches are resized to this side; 0 = as they are
  int multiple_of = 1;         ///< else padded up to a multiple of this by repeating the border
};

const std::set<std::string> kInputs = {"L100", "L01", "L-50", "L-1", "rgb01"};
const std::set<std::string> kOutputs = {"ab", "ab1", "logits313", "rgb01"};

std::string one_of(const std::set<std::string>& names) {
  std::string text = "expected one of";
  for (const std::string& name : names) text += " \"" + name + "\"";
  return text;
}

void read_name(const toml::node& node, const fs::path& file, const std::string& key, const std::set<std::string>& names,
               std::string& value) {
  const auto found = node.value<std::string>();
  if (!found || names.count(*found) == 0) throw InputError(file, key, one_of(names));
  value = *found;
}

void read_count(const toml::node& node, const fs::path& file, const std::string& key, int lowest, int& value) {
  const auto found = node.value<std::int64_t>();
  if (!found || *found < lowest || *found > 4096) {
    throw InputError(file, key, "expected a whole number from " + std::to_string(lowest) + " to 4096");
  }
  value = int(*found);
}

ModuleContract read_contract(const fs::path& file) {
  ModuleContract contract;
  if (!fs::exists(file)) return contract;
  toml::table table;
  try {
    table = toml::parse_file(file.string());
  } catch (const toml::parse_error& error) {
    throw InputError(file, "line " + std::to_string(error.source().begin.line), std::string(error.description()));
  }
  for (const auto& [name, node] : table) {
    const std::string key(name.str());
    if (key == "input") {
      read_name(node, file, key, kInputs, contract.input);
    } else if (key == "output") {
      read_name(node, file, key, kOutputs, contract.output);
    } else if (key == "size") {
      read_count(node, file, key, 0, contract.size);
    } else if (key == "multiple_of") {
      read_count(node, file, key, 1, contract.multiple_of);
    } else {
      throw InputError(file, key, "unknown key; expected input, output, size, multiple_of");
    }
  }
  return contract;
}

std::string shape_text(const Tensor& tensor) {
  std::string text = "[";
  for (int64_t i = 0; i < tensor.dim(); ++i) text += (i > 0 ? ", " : "") + std::to_string(tensor.size(i));
  return text + "]";
}

/// The first line: the rest is the interpreter's stack.
std::string first_line(const std::string& text) {
  const std::string line = text.substr(0, text.find('\n'));
  return line.empty() ? text : line;
}

/// What the interpreter reports: its own message stands last, below the stack.
std::string script_message(const std::string& text) {
  const std::size_t found = text.rfind("RuntimeError: ");
  return first_line(found == std::string::npos ? text : text.substr(found));
}

/// [B, 1, H, W] L* in the module's own unit, or [B, 3, H, W].
Tensor encode_input(const Tensor& lightness, const std::string& input) {
  if (input == "L01") return lightness / 100;
  if (input == "L-50") return lightness - 50;
  if (input == "L-1") return lightness / 50 - 1;
  if (input == "rgb01") {
    Tensor grey = lightness.clone();
    float* value = grey.data_ptr<float>();
    for (int64_t i = 0; i < grey.numel(); ++i) value[i] = srgb_from_linear(luminance_from_lightness(value[i]));
    return grey.repeat({1, 3, 1, 1});
  }
  return lightness;
}

Tensor ab_of_srgb(const Tensor& srgb) {
  const Tensor source = srgb.contiguous();
  const int64_t batch = source.size(0), pixels = source.size(2) * source.size(3);
  Tensor ab = torch::empty({batch, 2, source.size(2), source.size(3)});
  for (int64_t n = 0; n < batch; ++n) {
    const float* rgb = source.data_ptr<float>() + n * 3 * pixels;
    float* out = ab.data_ptr<float>() + n * 2 * pixels;
    for (int64_t i = 0; i < pixels; ++i) {
      Vec3<float> linear;
      for (int c = 0; c < 3; ++c) linear[c] = linear_from_srgb(rgb[c * pixels + i]);
      const Lab<float> lab = lab_from_linear_rgb(linear);
      out[i] = lab.a;
      out[pixels + i] = lab.b;
    }
  }
  return ab;
}

Tensor resized(const Tensor& image, int64_t height, int64_t width) {
  if (image.size(2) == height && image.size(3) == width) return image;
  return torch::upsample_bilinear2d(image, {height, width}, false);
}

class TorchScriptColorizer final : public Colorizer {
 public:
  TorchScriptColorizer(fs::path file, const std::string& shown)
      : name_("torchscript:" + shown), contract_(read_contract(file.string() + ".toml")) {
    try {
      module_ = torch::jit::load(file.string(), torch::kCPU);
      module_.eval();
    } catch (const std::exception& error) {
      throw ColorizerError(name_ + ": not a TorchScript module LibTorch " TORCH_VERSION " can load, or cut short: " +
                           first_line(error.what()));
    }
  }

  ChromaBatch colorize(const LightnessBatch& patches) override {
    torch::NoGradGuard no_grad;
    const int64_t height = patches.height, width = patches.width;
    const Tensor lightness = torch::from_blob(const_cast<float*>(patches.lightness.data()),
                                              {patches.batch, 1, height, width}, torch::kFloat32);
    const Tensor fitted = fit_size(lightness);
    const Tensor raw = run(encode_input(fitted, contract_.input));
    check_shape(raw, fitted);
    Tensor answer = to_answer(raw);
    // A size other than the input's (say, logits at a quarter) is brought back to it; then the padding goes.
    answer = resized(answer, fitted.size(2), fitted.size(3));
    if (contract_.size > 0) {
      answer = resized(answer, height, width);
    } else {
      answer = answer.slice(2, 0, height).slice(3, 0, width);
    }
    answer = answer.contiguous();
    ChromaBatch result{patches.batch, patches.height, patches.width, {}, {}};
    std::vector<float>& values = contract_.output == "logits313" ? result.logits : result.ab;
    values.assign(answer.data_ptr<float>(), answer.data_ptr<float>() + answer.numel());
    check_answer(name_, patches, result);
    return result;
  }

  [[nodiscard]] std::string name() const override { return name_; }

 private:
  [[nodiscard]] Tensor fit_size(const Tensor& lightness) const {
    if (contract_.size > 0) return resized(lightness, contract_.size, contract_.size).contiguous();
    const int64_t m = contract_.multiple_of, h = lightness.size(2), w = lightness.size(3);
    const int64_t down = (h + m - 1) / m * m - h, right = (w + m - 1) / m * m - w;
    return down == 0 && right == 0 ? lightness : torch::replication_pad2d(lightness, {0, right, 0, down});
  }

  Tensor run(const Tensor& input) {
    try {
      const torch::IValue result = module_.forward({input});
      if (result.isTensor()) return result.toTensor().to(torch::kCPU, torch::kFloat32);
    } catch (const std::exception& error) {
      throw ColorizerError(name_ + ": failed on an input of " + shape_text(input) + ": " +
                           script_message(error.what()));
    }
    throw ColorizerError(name_ + ": expected a tensor, got something else");
  }

  void check_shape(const Tensor& raw, const Tensor& input) const {
    const int64_t channels = contract_.output == "logits313" ? kAbBinCount : contract_.output == "rgb01" ? 3 : 2;
    if (raw.dim() == 4 && raw.size(0) == input.size(0) && raw.size(1) == channels && raw.numel() > 0) return;
    throw ColorizerError(name_ + ": expected [" + std::to_string(input.size(0)) + ", " + std::to_string(channels) +
                         ", H, W] for output \"" + contract_.output + "\", got " + shape_text(raw) +
                         "; what a module answers is declared in FILE.toml");
  }

  [[nodiscard]] Tensor to_answer(const Tensor& raw) const {
    if (contract_.output == "rgb01") return ab_of_srgb(raw);
    return contract_.output == "ab1" ? raw * 110 : raw;
  }

  std::string name_;
  ModuleContract contract_;
  torch::jit::Module module_;
};

}  // namespace

std::unique_ptr<Colorizer> make_torchscript_colorizer(const std::string& argument, const ColorizerOptions& options) {
  return std::make_unique<TorchScriptColorizer>(find_spec_file(argument, options), argument);
}

}  // namespace cnerf

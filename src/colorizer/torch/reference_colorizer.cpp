// Fitted weights are kept in the cache folder, so that a resumed run asks the very network the first one fitted.

#include <array>
#include <cstring>
#include <optional>
#include <span>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/colorizer/torch/encoder.h"
#include "src/colorizer/torch/network_weights.h"
#include "src/colorizer/torch/products.h"
#include "src/colorizer/torch/reference_images.h"
#include "src/colorizer/torch/reference_network.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;

/// The files of a folder in the order of their names, or the file itself.
std::vector<fs::path> files_of(const fs::path& place) {
  if (!fs::is_directory(place)) return {place};
  std::vector<fs::path> files =
      files_in(place, [](const fs::path& file) { return !file.filename().string().starts_with('.'); });
  if (files.empty()) throw MissingInputError(place.string() + ": holds no reference photographs");
  return files;
}

/// `a.jpg,b.jpg` or a folder.
std::vector<fs::path> reference_files(const ColorizerRequest& request) {
  std::vector<fs::path> files = find_spec_files(request);
  if (files.empty()) throw UsageError("colorizer \"" + request.options.spec + "\": names no image");
  return files.size() == 1 ? files_of(files.front()) : files;
}

/// Of all that a user decides of the weights: the photographs' bytes, in their order, the recipe and the seed.
std::string fit_hash(const std::vector<fs::path>& files, const ReferenceRecipe& recipe, std::uint64_t seed) {
  std::string text = recipe.text() + "; seed " + std::to_string(seed);
  for (const fs::path& file : files) text += "; " + sha256(read_binary_file(file));
  return sha256(std::as_bytes(std::span(text)));
}

/// Processors that multiply in bf16 come to other weights, which a take may be gone on with all the same.
std::string cache_name(const std::string& hash, const ReferenceRecipe& recipe) {
  const bool is_bf16 = !recipe.builtin.empty() && product_type() != torch::kFloat32;
  return "reference-" + hash.substr(0, 16) + (is_bf16 ? "-bf16" : "") + ".weights";
}

constexpr std::array<char, 8> kWeightsMagic{'C', 'N', 'R', 'E', 'F', 'N', 'E', '1'};
constexpr std::size_t kHashLength = 64;

void save_weights(const fs::path& file, const std::vector<float>& weights) {
  const auto bytes = std::as_bytes(std::span(weights));
  const std::string hash = sha256(bytes);
  std::vector<std::byte> content(kWeightsMagic.size() + hash.size() + bytes.size());
  std::memcpy(content.data(), kWeightsMagic.data(), kWeightsMagic.size());
  std::memcpy(content.data() + kWeightsMagic.size(), hash.data(), hash.size());
  std::memcpy(content.data() + kWeightsMagic.size() + hash.size(), bytes.data(), bytes.size());
  write_file(file, content);
}

/// Nothing when the file is missing, damaged or of another network: it is a cache, the fit can be repeated.
std::optional<std::vector<float>> load_weights(const fs::path& file, std::size_t count) {
  if (!fs::exists(file)) return std::nullopt;
  const std::vector<std::byte> content = read_binary_file(file);
  const std::size_t header = kWeightsMagic.size() + kHashLength;
  if (content.size() != header + count * sizeof(float)) return std::nullopt;
  if (std::memcmp(content.data(), kWeightsMagic.data(), kWeightsMagic.size()) != 0) return std::nullopt;
  const auto payload = std::span(content).subspan(header);
  if (std::memcmp(content.data() + kWeightsMagic.size(), sha256(payload).data(), kHashLength) != 0) {
    return std::nullopt;
  }
  std::vector<float> weights(count);
  std::memcpy(weights.data(), payload.data(), payload.size());
  return weights;
}

class ReferenceColorizer final : public Colorizer {
 public:
  ReferenceColorizer(std::string name, ReferenceNetwork network)
      : name_(std::move(name)), network_(std::move(network)) {}

  ChromaBatch colorize(const LightnessBatch& patches) override {
    ChromaBatch answer = network_.colorize(patches);
    check_answer(name_, patches, answer);
    return answer;
  }
  [[nodiscard]] std::string name() const override { return name_; }

 private:
  std::string name_;
  ReferenceNetwork network_;
};

/// @throws MissingInputError  it was asked for and is not installed.
bool wants_encoder(const ColorizerRequest& request) {
  const std::string& choice = request.options.reference_encoder;
  if (choice == "off") return false;
  if (is_encoder_installed()) return true;
  const std::string missing = "no encoder in " + encoder_folder().string();
  if (choice == "on") {
    throw MissingInputError("colorizer.reference_encoder: " + missing +
                            "; scripts/install_dependencies.sh --encoder installs it");
  }
  if (request.context.say) request.context.say("reference: fits without the optional encoder: " + missing);
  return false;
}

}  // namespace

std::unique_ptr<Colorizer> make_reference_colorizer(const ColorizerRequest& request) {
  ReferenceRecipe recipe;
  recipe.steps = request.options.reference_steps;
  if (request.options.reference_on_builtin) use_builtin(recipe, builtin_weights_file());
  if (wants_encoder(request)) use_encoder(recipe, load_encoder(encoder_folder()));
  return fit_reference_colorizer(request, recipe);
}

std::unique_ptr<Colorizer> fit_reference_colorizer(const ColorizerRequest& request, const ReferenceRecipe& recipe) {
  const std::vector<fs::path> files = reference_files(request);
  std::vector<ReferenceImage> images;
  for (const fs::path& file : files) images.push_back(load_reference_image(file));

  const ColorizerContext& context = request.context;
  const std::string with = recipe.encoder ? " with encoder " + recipe.encoder->sha256().substr(0, 8) : "";
  const std::string hash = fit_hash(files, recipe, context.seed);
  const std::string name = "reference:" + request.argument + with + " (" + hash.substr(0, 8) + ")";
  ReferenceNetwork network(recipe, images, context.seed);
  const fs::path cache = context.cache_folder.empty() ? fs::path() : context.cache_folder / cache_name(hash, recipe);
  if (!cache.empty()) {
    if (const auto weights = load_weights(cache, network.weights().size())) {
      network.set_weights(*weights);
      return std::make_unique<ReferenceColorizer>(name, std::move(network));
    }
  }
  network.fit(images, context.progress);
  if (!cache.empty()) save_weights(cache, network.weights());
  return std::make_unique<ReferenceColorizer>(name, std::move(network));
}

}  // namespace cnerf

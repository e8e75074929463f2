#include "src/compare/methods.h"

#include <algorithm>
#include <sstream>

#include "src/base/error.h"
#include "src/base/text.h"

namespace cnerf::compare {

std::vector<std::string> method_names() {
  std::vector<std::string> names;
  for (const Method& method : kMethods) names.emplace_back(method.name);
  return names;
}

std::vector<const Method*> parse_methods(const std::string& list) {
  std::vector<const Method*> methods;
  for (const Method& method : kMethods) {
    if (list == "all") methods.push_back(&method);
  }
  std::istringstream words(list);
  for (std::string word; list != "all" && std::getline(words, word, ',');) {
    const auto* found = std::ranges::find(kMethods, word, &Method::name);
    if (found == std::end(kMethods)) {
      throw UsageError("--methods: no method '" + word + "'; there are: " + joined(method_names(), ", "));
    }
    if (std::ranges::find(methods, found) == methods.end()) methods.push_back(found);
  }
  if (methods.empty()) throw UsageError("--methods: expected names, or all");
  return methods;
}

Stage2Options stage2_of(const Method& method, Stage2Options configured) {
  Stage2Options options = std::move(configured);
  if (std::string_view(method.name) == "colornerf-paper") {
    options.decode_temperature = options.spread_weight = options.regression_weight = options.sure_colors = 0;
    options.purify.opinions = 1;
  }
  options.purify.enabled = options.purify.enabled && method.is_purified;
  if (method.is_photometric) {
    // The photometric loss is not to lose because of a step size chosen for classes.
    options.learning_rate = Stage2Options{}.learning_rate;
    options.final_learning_rate = Stage2Options{}.final_learning_rate;
  }
  if (method.has_own_field) {
    options.learning_rate = kPositionalLearningRate;
    options.final_learning_rate = kPositionalFinalLearningRate;
  }
  options.distill_steps = 0;  // nothing is baked
  return options;
}

}  // namespace cnerf::compare

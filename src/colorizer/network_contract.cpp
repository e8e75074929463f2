#include "src/colorizer/network_contract.h"

#include <toml++/toml.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <set>
#include <span>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/process.h"
#include "src/color/ab_bins.h"
#include "src/color/colorspace_math.h"
#include "src/colorizer/kinds.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;

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
  const auto found = node.value_exact<std::int64_t>();  // a float might be none that the type holds
  if (!found || *found < lowest || *found > 4096) {
    throw InputError(file, key, "expected a whole number from " + std::to_string(lowest) + " to 4096");
  }
  value = int(*found);
}

float in_unit(float lightness, const std::string& unit) {
  if (unit == "L01") return lightness / 100;
  if (unit == "L-50") return lightness - 50;
  if (unit == "L-1") return lightness / 50 - 1;
  if (unit == "rgb01") return srgb_from_linear(luminance_from_lightness(lightness));
  return lightness;
}

/// Every plane resized, bilinear with pixel centres at halves.
Planes resized(const Planes& planes, int height, int width) {
  if (planes.height == height && planes.width == width) return planes;
  Planes out{planes.batch, planes.channels, height, width, {}};
  out.values.resize(std::size_t(out.batch) * std::size_t(out.channels) * out.plane_size());
  for (std::size_t i = 0; i < std::size_t(planes.batch) * std::size_t(planes.channels); ++i) {
    const cv::Mat from(planes.height, planes.width, CV_32F,
                       const_cast<float*>(planes.values.data() + i * planes.plane_size()));
    cv::Mat to(height, width, CV_32F, out.values.data() + i * out.plane_size());
    cv::resize(from, to, to.size(), 0, 0, cv::INTER_LINEAR);
  }
  return out;
}

/// Cut off or grown on the right and below; what is new repeats the border.
Planes with_size(const Planes& planes, int height, int width) {
  Planes out{planes.batch, planes.channels, height, width, {}};
  out.values.reserve(std::size_t(out.batch) * std::size_t(out.channels) * out.plane_size());
  for (std::size_t i = 0; i < std::size_t(planes.batch) * std::size_t(planes.channels); ++i) {
    const float* from = planes.values.data() + i * planes.plane_size();
    for (int y = 0; y < height; ++y) {
      const float* row = from + std::size_t(std::min(y, planes.height - 1)) * std::size_t(planes.width);
      for (int x = 0; x < width; ++x) out.values.push_back(row[std::min(x, planes.width - 1)]);
    }
  }
  return out;
}

Planes ab_of_srgb(const Planes& srgb) {
  Planes ab{srgb.batch, 2, srgb.height, srgb.width, {}};
  const std::size_t pixels = srgb.plane_size();
  ab.values.resize(std::size_t(ab.batch) * 2 * pixels);
  for (std::size_t n = 0; n < std::size_t(srgb.batch); ++n) {
    const float* rgb = srgb.values.data() + n * 3 * pixels;
    float* out = ab.values.data() + n * 2 * pixels;
    for (std::size_t i = 0; i < pixels; ++i) {
      const Lab<float> lab = lab_from_linear_rgb(Vec3<float>{
          linear_from_srgb(rgb[i]), linear_from_srgb(rgb[pixels + i]), linear_from_srgb(rgb[2 * pixels + i])});
      out[i] = lab.a;
      out[pixels + i] = lab.b;
    }
  }
  return ab;
}

int rounded_up(int value, int multiple) {
  return (value + multiple - 1) / multiple * multiple;
}

fs::path contract_file(const fs::path& network) {
  return network.string() + ".toml";
}

}  // namespace

int NetworkContract::output_channels() const {
  return output == "logits313" ? kAbBinCount : output == "rgb01" ? 3 : 2;
}

void read_in_child(const std::function<void()>& read, double seconds, const fs::path& file,
                   const std::string& damaged) {
  constexpr std::size_t kLeast = std::size_t(512) << 20, kPerByte = 8;
  std::error_code unknown;
  const std::uintmax_t size = fs::file_size(file, unknown);
  const auto failure = failure_in_child(read, seconds, kLeast + (unknown ? 0 : size * kPerByte));
  if (failure) throw ColorizerError(failure->empty() ? damaged : *failure);
}

NetworkContract contract_beside(const fs::path& network) {
  const fs::path file = contract_file(network);
  NetworkContract contract;
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
    } else if (key == "layer") {
      if (!node.is_string()) throw InputError(file, key, "expected the name of a layer");
      contract.layer = *node.value<std::string>();
    } else if (key == "size") {
      read_count(node, file, key, 0, contract.size);
    } else if (key == "multiple_of") {
      read_count(node, file, key, 1, contract.multiple_of);
    } else {
      throw InputError(file, key, "unknown key; expected input, output, layer, size, multiple_of");
    }
  }
  return contract;
}

std::string Planes::shape_text() const {
  return "[" + std::to_string(batch) + ", " + std::to_string(channels) + ", " + std::to_string(height) + ", " +
         std::to_string(width) + "]";
}

Planes network_input(const NetworkContract& contract, const LightnessBatch& question) {
  const Planes lightness{question.batch, 1, question.height, question.width, question.lightness};
  const Planes fitted = contract.size > 0 ? resized(lightness, contract.size, contract.size)
                                          : with_size(lightness, rounded_up(question.height, contract.multiple_of),
                                                      rounded_up(question.width, contract.multiple_of));
  Planes input{fitted.batch, contract.input == "rgb01" ? 3 : 1, fitted.height, fitted.width, {}};
  input.values.reserve(fitted.values.size() * std::size_t(input.channels));
  for (std::size_t n = 0; n < std::size_t(fitted.batch); ++n) {
    for (int channel = 0; channel < input.channels; ++channel) {
      for (std::size_t i = 0; i < fitted.plane_size(); ++i) {
        input.values.push_back(in_unit(fitted.values[n * fitted.plane_size() + i], contract.input));
      }
    }
  }
  return input;
}

ChromaBatch chroma_of(const NetworkContract& contract, const Planes& raw, const Planes& asked,
                      const LightnessBatch& question, const std::string& colorizer) {
  if (raw.batch != asked.batch || raw.channels != contract.output_channels() || raw.values.empty()) {
    throw ColorizerError(colorizer + ": expected [" + std::to_string(asked.batch) + ", " +
                         std::to_string(contract.output_channels()) + ", H, W] for output \"" + contract.output +
                         "\", got " + raw.shape_text() + "; what a network answers is declared in FILE.toml");
  }
  Planes answer = contract.output == "rgb01" ? ab_of_srgb(raw) : raw;
  if (contract.output == "ab1") {
    for (float& value : answer.values) value *= 110;
  }
  answer = resized(answer, asked.height, asked.width);
  answer = contract.size > 0 ? resized(answer, question.height, question.width)
                             : with_size(answer, question.height, question.width);
  ChromaBatch chroma{question.batch, question.height, question.width, {}, {}};
  (contract.output == "logits313" ? chroma.logits : chroma.ab) = std::move(answer.values);
  check_answer(colorizer, question, chroma);
  return chroma;
}

NetworkColorizer::NetworkColorizer(std::string name, const std::vector<fs::path>& files)
    : name_(std::move(name)), contract_(contract_beside(files.back())) {
  std::string hashes;
  for (const fs::path& file : files) hashes += sha256_of_file(file);
  const fs::path contract = contract_file(files.back());
  if (fs::exists(contract)) hashes += sha256_of_file(contract);
  hash_ = sha256(std::as_bytes(std::span(hashes))).substr(0, 8);
}

namespace {

/// Where a name of a spec leads to; empty where there is nothing.
fs::path place_of(const std::string& name, const fs::path& folder) {
  for (const fs::path& place : {folder / name, fs::path(name)}) {
    std::error_code failure;
    if (fs::exists(place, failure)) return place;
    const bool is_list = failure == std::errc::filename_too_long;  // of files, none of which has so long a name
    if (failure && !is_list) throw fs::filesystem_error("", place, failure);
  }
  return {};
}

}  // namespace

fs::path find_spec_file(const std::string& name, const ColorizerRequest& request) {
  const fs::path& folder = request.context.working_folder;
  if (fs::path place = place_of(name, folder); !place.empty()) return place;
  std::string message = "colorizer \"" + request.options.spec + "\": no file " + name;
  if (!folder.empty() && folder / name != name) message += ", nor " + (folder / name).string();
  throw MissingInputError(message);
}

std::vector<fs::path> find_spec_files(const ColorizerRequest& request) {
  const std::string& list = request.argument;
  const fs::path& folder = request.context.working_folder;
  if (const fs::path whole = place_of(list, folder); !whole.empty()) return {whole};
  const auto comma_from = [&](std::size_t at) { return std::min(list.find(',', at), list.size()); };
  std::vector<fs::path> files;
  for (std::size_t begin = 0; begin < list.size();) {
    const std::size_t first = comma_from(begin);
    std::size_t end = first;
    const auto is_file = [&] {
      std::error_code failure;
      return fs::is_regular_file(place_of(list.substr(begin, end - begin), folder), failure);
    };
    while (!is_file() && end < list.size()) end = comma_from(end + 1);
    if (!is_file()) end = first;  // which is refused by that name
    if (end > begin) files.push_back(find_spec_file(list.substr(begin, end - begin), request));
    begin = end + 1;
  }
  return files;
}

std::string first_line(const std::string& text) {
  const std::string line = text.substr(0, text.find('\n'));
  return line.empty() ? text : line;
}

}  // namespace cnerf

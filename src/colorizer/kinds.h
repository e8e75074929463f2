#pragma once
/// The kinds behind `make_colorizer`, one factory each. `argument` is what follows the colon of the spec.

#include <memory>
#include <string>

#include "src/colorizer/colorizer.h"

namespace cnerf {

/// Answers a = b = 0: for tests, and as the baseline every colorizer must beat.
std::unique_ptr<Colorizer> make_grey_colorizer(const std::string& argument, const ColorizerOptions& options);

/// `IMAGE[,IMAGE…]`: a small network fitted to colour photographs of the scene.
std::unique_ptr<Colorizer> make_reference_colorizer(const std::string& argument, const ColorizerOptions& options);

/// `FILE`: a scripted LibTorch module, see docs/colorizers.md.
std::unique_ptr<Colorizer> make_torchscript_colorizer(const std::string& argument, const ColorizerOptions& options);

/// `FILE`: a network in the ONNX format, run by OpenCV.
std::unique_ptr<Colorizer> make_onnx_colorizer(const std::string& argument, const ColorizerOptions& options);

/// `PROTO,MODEL`: a Caffe network, run by OpenCV.
std::unique_ptr<Colorizer> make_caffe_colorizer(const std::string& argument, const ColorizerOptions& options);

/// `COMMAND`: any program that speaks the pipe protocol of docs/colorizers.md. `{prompt}` in it becomes the prompt.
std::unique_ptr<Colorizer> make_exec_colorizer(const std::string& argument, const ColorizerOptions& options);

/// Whether a command says that it takes a prompt.
[[nodiscard]] bool takes_prompt(const std::string& command);

/// `[FILE]`: the network whose weights come with the program.
std::unique_ptr<Colorizer> make_builtin_colorizer(const std::string& argument, const ColorizerOptions& options);

/// Looks `name` up in the working folder, then as given.
/// @throws MissingInputError  naming both places.
[[nodiscard]] std::filesystem::path find_spec_file(const std::string& name, const ColorizerOptions& options);

}  // namespace cnerf

#pragma once
/// The kinds of colorizers behind `make_colorizer`, one factory each.

#include <memory>
#include <string>

#include "src/colorizer/colorizer.h"
#include "src/colorizer/picture_encoder.h"

namespace cnerf {

/// What a factory is told.
struct ColorizerRequest {
  std::string argument;  ///< what follows the colon of the spec
  const ColorizerOptions& options;
  const ColorizerContext& context;
};
using MakeColorizer = std::unique_ptr<Colorizer>(const ColorizerRequest& request);

MakeColorizer make_grey_colorizer;         ///< a = b = 0: for tests, and as the baseline every colorizer must beat
MakeColorizer make_builtin_colorizer;      ///< `[FILE]`: the network whose weights come with the program
MakeColorizer make_reference_colorizer;    ///< `IMAGE[,IMAGE…]`: a small network fitted to photographs of the scene
MakeColorizer make_torchscript_colorizer;  ///< `FILE`: a scripted LibTorch module, see docs/colorizers.md
MakeColorizer make_onnx_colorizer;         ///< `FILE`: a network in the ONNX format, run by OpenCV: the fallback
MakeColorizer make_caffe_colorizer;        ///< `PROTO,MODEL`: a Caffe network, run by OpenCV
/// `COMMAND`: any program that speaks the pipe protocol of docs/colorizers.md. `{prompt}` in it becomes the prompt.
MakeColorizer make_exec_colorizer;

/// What libcnerf_torch.so offers: the colorizers that need LibTorch, and the encoder.
struct TorchColorizers {
  MakeColorizer* builtin;
  MakeColorizer* reference;
  MakeColorizer* torchscript;
  decltype(make_picture_encoder)* encoder;  ///< where it is installed
  const char* version;                      ///< of LibTorch
};

/// What libcnerf_onnxruntime.so offers; builds without ONNX Runtime have no such plug-in.
struct OnnxRuntimeColorizers {
  MakeColorizer* onnx;
  const char* version;  ///< "ONNX Runtime 1.21.0"
};

/// Whether a command says that it takes a prompt.
[[nodiscard]] bool takes_prompt(const std::string& command);

/// Looks `name` up in the working folder, then as given.
/// @throws MissingInputError  naming both places.
[[nodiscard]] std::filesystem::path find_spec_file(const std::string& name, const ColorizerRequest& request);

/// The same of `FILE,FILE…`, or of the one file or folder that the whole argument names. Names may hold commas.
[[nodiscard]] std::vector<std::filesystem::path> find_spec_files(const ColorizerRequest& request);

}  // namespace cnerf

// torchscript:FILE, a scripted LibTorch module; docs/colorizers.md describes FILE.toml.

#include <ATen/Parallel.h>
#include <fmt/format.h>
#include <torch/script.h>
#include <torch/version.h>

#include <chrono>
#include <future>
#include <new>
#include <thread>

#include "src/base/error.h"
#include "src/colorizer/kinds.h"
#include "src/colorizer/network_contract.h"

namespace cnerf {
namespace {

namespace fs = std::filesystem;
using torch::Tensor;

/// What the interpreter reports: its own message stands last, below the stack.
std::string script_message(const std::string& text) {
  const std::size_t found = text.rfind("RuntimeError: ");
  return first_line(found == std::string::npos ? text : text.substr(found));
}

std::string shape_text(const Tensor& tensor) {
  std::string text = "[";
  for (int64_t i = 0; i < tensor.dim(); ++i) text += (i > 0 ? ", " : "") + std::to_string(tensor.size(i));
  return text + "]";
}

class TorchScriptColorizer final : public NetworkColorizer {
 public:
  TorchScriptColorizer(const fs::path& file, const std::string& shown, double timeout_seconds)
      : NetworkColorizer("torchscript:" + shown, {file}), timeout_(timeout_seconds) {
    const auto load = [&] {
      try {
        return torch::jit::load(file.string(), torch::kCPU);
      } catch (const std::bad_alloc&) {
        throw;
      } catch (const std::exception& error) {
        throw ColorizerError(name_ + ": not a TorchScript module LibTorch " TORCH_VERSION " can load, or cut short: " +
                             first_line(error.what()));
      }
    };
    const auto load_alone = [&] {
      at::set_num_threads(1);  // a pool of threads does not survive a fork
      (void)load();
    };
    read_in_child(load_alone, timeout_seconds, file,
                  name_ + ": is damaged: LibTorch " TORCH_VERSION " cannot stand or end reading it");
    module_ = load();
    module_.eval();
  }

 private:
  Planes run(const Planes& input) override {
    const Tensor question = torch::from_blob(const_cast<float*>(input.values.data()),
                                             {input.batch, input.channels, input.height, input.width}, torch::kFloat32)
                                .clone();  // outlives this call where there is no answer in time
    Tensor answer;
    try {
      const torch::IValue result = forward(question);
      if (result.isTensor()) answer = result.toTensor().to(torch::kCPU, torch::kFloat32).contiguous();
    } catch (const ColorizerError&) {
      throw;
    } catch (const std::exception& error) {
      throw ColorizerError(name_ + ": failed on an input of " + input.shape_text() + ": " +
                           script_message(error.what()));
    }
    if (!answer.defined()) throw ColorizerError(name_ + ": expected a tensor, got something else");
    if (answer.dim() != 4) {
      throw ColorizerError(name_ + ": expected four dimensions, [B, C, H, W], got " + shape_text(answer));
    }
    const auto* values = answer.data_ptr<float>();
    return {int(answer.size(0)),
            int(answer.size(1)),
            int(answer.size(2)),
            int(answer.size(3)),
            {values, values + answer.numel()}};
  }

  /// A script may run for ever, and nothing stops a thread of it: it is left behind, and the program ends soon.
  torch::IValue forward(const Tensor& question) {
    std::packaged_task<torch::IValue()> task([module = module_, question, threads = at::get_num_threads()]() mutable {
      at::set_num_threads(threads);  // a thread begins with all cores
      const torch::NoGradGuard no_grad;
      return module.forward({question});
    });
    std::future<torch::IValue> result = task.get_future();
    std::thread thread(std::move(task));
    if (result.wait_for(timeout_) == std::future_status::ready) {
      thread.join();
      return result.get();
    }
    thread.detach();
    throw ColorizerError(fmt::format("{}: gave no answer within {:g} s", name_, timeout_.count()));
  }

  torch::jit::Module module_;
  std::chrono::duration<double> timeout_;
};

}  // namespace

std::unique_ptr<Colorizer> make_torchscript_colorizer(const ColorizerRequest& request) {
  return std::make_unique<TorchScriptColorizer>(find_spec_file(request.argument, request), request.argument,
                                                request.options.timeout_seconds);
}

}  // namespace cnerf

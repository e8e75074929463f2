/// Writes a TorchScript module whose answer is L and -L:  torchscript_module FILE

#include <torch/script.h>

int main(int argc, char** argv) {
  if (argc != 2) return 64;
  torch::jit::Module module("m");
  module.define("def forward(self, x):\n    return torch.cat([0.5 * x, -0.5 * x], 1)\n");
  module.save(argv[1]);
  return 0;
}

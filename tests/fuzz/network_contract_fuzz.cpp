/// The TOML file beside a network, and what follows from it for a small question.

#include "src/colorizer/network_contract.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(network_contract) {
  using namespace cnerf;
  constexpr int kMostSide = 64;
  const auto file = fuzz::scratch_file("net.pt.toml", input);
  fuzz::read_or_refuse(file, [&] {
    const NetworkContract contract = contract_beside(file.parent_path() / "net.pt");
    if (contract.size > kMostSide || contract.multiple_of > kMostSide) return;
    LightnessBatch question;
    question.batch = 1;
    question.height = 3;
    question.width = 5;
    question.lightness.assign(15, 50.0f);
    const Planes asked = network_input(contract, question);
    Planes answer{1, contract.output_channels(), 2, 2, {}};
    answer.values.assign(std::size_t(answer.channels) * answer.plane_size(), 0.5f);
    (void)chroma_of(contract, answer, asked, question, file.string());
  });
}

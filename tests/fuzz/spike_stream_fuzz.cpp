/// A stream of a spike camera: width, height, window and pictures in a byte each, then the stream.

#include "src/prepare/spike_stream.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(spike_stream) {
  using namespace cnerf;
  prepare::SpikeOptions options;
  options.spike_width = int(fuzz::take_byte(input) % 32);
  options.spike_height = int(fuzz::take_byte(input) % 32);
  options.spike_window = 1 + int(fuzz::take_byte(input) % 8);
  options.spike_flip = input.size() % 2 == 1;
  const int pictures = 2 + int(fuzz::take_byte(input) % 3);
  const auto file = fuzz::scratch_file("stream.dat", input);
  fuzz::read_or_refuse(
      file, [&] { return prepare::import_spikes(file, fuzz::scratch_folder() / "spikes", options, pictures, {}); });
  std::error_code ignored;
  std::filesystem::remove_all(fuzz::scratch_folder() / "spikes", ignored);
}

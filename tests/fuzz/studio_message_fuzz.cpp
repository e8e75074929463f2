/// What a studio's page sends: by the first byte an order, a camera to look through, or any record of the server's.

#include "src/base/json_record.h"
#include "src/studio/messages.h"
#include "tests/fuzz/fuzz_target.h"

CNERF_FUZZ_TARGET(studio_message) {
  using namespace cnerf;
  const unsigned kind = fuzz::take_byte(input) % 3;
  const std::string text = fuzz::text_of(input);
  fuzz::read_or_refuse("frame", [&] {
    const auto json = parse_json(text, "frame");
    if (kind == 0) return json_of(record_of<studio::OrderMessage>(json, "frame")).dump();
    if (kind == 2) return json_of(record_of<studio::StateMessage>(json, "frame")).dump();
    const auto frame = record_of<studio::FrameMessage>(json, "frame");
    (void)studio::camera_of(frame);
    return json_of(frame).dump();
  });
}

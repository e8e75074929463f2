#include "src/colorizer/onnx_tensors.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <set>
#include <stdexcept>
#include <vector>

#include "src/base/text.h"

namespace cnerf {
namespace {

constexpr int kDeepest = 100;  // messages within each other, as in the library of protocol buffers
constexpr std::size_t kLongestName = 60;
constexpr const char* kDamaged = "it is no ONNX, or damaged";

struct Fault : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The fields of a message in the wire format of protocol buffers, one after the other.
class Fields {
 public:
  struct Field {
    std::uint64_t number = 0, value = 0;
    bool is_number = false;  ///< alone, with `value` where it is of variable length; else `bytes` has it, or several
    std::string_view bytes{};
  };

  explicit Fields(std::string_view rest) : rest_(rest) {}
  [[nodiscard]] bool any() const { return !rest_.empty(); }

  Field next() {
    const std::uint64_t tag = number();
    switch (tag & 7) {
      case 0:
        return {tag >> 3, number(), true};
      case 1:
        return {tag >> 3, 0, true, take(8)};
      case 2:
        return {tag >> 3, 0, false, take(number())};
      case 5:
        return {tag >> 3, 0, true, take(4)};
      default:
        throw Fault(kDamaged);
    }
  }

  std::uint64_t number() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      const auto byte = static_cast<unsigned char>(take(1).front());
      value |= std::uint64_t(byte & 0x7F) << shift;
      if (byte < 0x80) return value;
    }
    throw Fault(kDamaged);
  }

 private:
  std::string_view take(std::uint64_t count) {
    if (count > rest_.size()) throw Fault(kDamaged);
    const std::string_view taken = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return taken;
  }
  std::string_view rest_;
};

/// Fields of a TensorProto. Numbers are in the list of their type, or all in kRaw.
enum TensorField : std::uint64_t {
  kSides = 1,
  kType = 2,
  kFloats = 4,
  kIntegers = 5,  ///< up to 32 bits, and halves
  kLongIntegers = 7,
  kName = 8,
  kRaw = 9,
  kDoubles = 10,
  kTensorFields
};

bool is_list(std::uint64_t field) {
  return field == kFloats || field == kIntegers || field == kLongIntegers || field == kDoubles;
}

/// Where numbers of a TensorProto.DataType are listed.
TensorField list_of(std::uint64_t type) {
  constexpr std::uint64_t kFloat = 1, kInt64 = 7, kDouble = 11;
  return type == kFloat ? kFloats : type == kInt64 ? kLongIntegers : type == kDouble ? kDoubles : kIntegers;
}

std::uint64_t numbers_in(const Fields::Field& list) {
  if (list.is_number) return 1;
  if (list.number == kFloats) return list.bytes.size() / sizeof(float);
  if (list.number == kDoubles) return list.bytes.size() / sizeof(double);
  return std::uint64_t(std::ranges::count_if(list.bytes, [](char byte) { return (byte & 0x80) == 0; }));
}

void check_tensor(std::string_view message) {
  // By TensorProto.DataType, 0 = none that is read here.
  constexpr std::array<std::uint64_t, 17> kBytesOf = {0, 4, 1, 1, 2, 2, 4, 8, 0, 1, 2, 8, 4, 8, 8, 16, 2};
  std::uint64_t type = 0, raw = 0, stated = 1;
  std::array<std::uint64_t, kTensorFields> listed{};
  std::string_view name;
  const auto multiply = [&](std::uint64_t size) {
    constexpr std::uint64_t kMost = std::numeric_limits<std::int32_t>::max();
    if (size > kMost) throw Fault("a tensor has a side of less than nothing, or of too much");
    stated = std::min(stated, kMost) * size;
  };
  for (Fields fields(message); fields.any();) {
    const Fields::Field field = fields.next();
    if (field.number == kSides && field.is_number) multiply(field.value);
    if (field.number == kSides && !field.is_number) {
      for (Fields sides(field.bytes); sides.any();) multiply(sides.number());
    }
    if (field.number == kType) type = field.value;
    if (field.number == kName) name = field.bytes;
    if (field.number == kRaw) raw = field.bytes.size();
    if (is_list(field.number)) listed[field.number] += numbers_in(field);
  }
  const bool is_empty = raw == 0 && std::ranges::all_of(listed, [](std::uint64_t count) { return count == 0; });
  if (is_empty || type >= kBytesOf.size() || kBytesOf[type] == 0) return;  // which OpenCV takes, or refuses itself
  const std::uint64_t in_list = listed[list_of(type)], held = in_list > 0 ? in_list : raw / kBytesOf[type];
  if (held < stated) {
    throw Fault(fmt::format("the tensor \"{}\" states {} numbers and holds {}",
                            printable(std::string(name.substr(0, kLongestName))), stated, held));
  }
}

enum class Message { kModel, kGraph, kNode, kAttribute, kTensor };

struct Child {
  Message of;
  std::uint64_t field;
  Message kind;
  bool is_list;
};
constexpr std::array<Child, 8> kChildren = {{{Message::kModel, 7, Message::kGraph, false},
                                             {Message::kGraph, 1, Message::kNode, true},
                                             {Message::kGraph, 5, Message::kTensor, true},
                                             {Message::kNode, 5, Message::kAttribute, true},
                                             {Message::kAttribute, 5, Message::kTensor, false},
                                             {Message::kAttribute, 6, Message::kGraph, false},
                                             {Message::kAttribute, 10, Message::kTensor, true},
                                             {Message::kAttribute, 11, Message::kGraph, true}}};

/// Every tensor below a message.
void check(Message kind, std::string_view message, int depth) {
  if (kind == Message::kTensor) return check_tensor(message);
  if (depth > kDeepest) throw Fault("its parts nest deeper than " + std::to_string(kDeepest));
  std::set<std::uint64_t> seen;
  for (Fields fields(message); fields.any();) {
    const Fields::Field field = fields.next();
    const auto child =
        std::ranges::find_if(kChildren, [&](const Child& one) { return one.of == kind && one.field == field.number; });
    if (child == kChildren.end()) continue;
    // Two of what is no list would be merged: each may be whole, and their sum is not.
    if (field.is_number || (!child->is_list && !seen.insert(field.number).second)) {
      throw Fault(kDamaged);
    }
    check(child->kind, field.bytes, depth + 1);
  }
}

}  // namespace

std::string fault_of_onnx(std::string_view model) {
  try {
    check(Message::kModel, model, 0);
  } catch (const Fault& fault) {
    return fault.what();
  }
  return "";
}

}  // namespace cnerf

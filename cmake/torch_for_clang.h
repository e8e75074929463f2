// Included first where clang reads LibTorch's headers, which scripts/tidy.sh does. They hold vectors of a type that is
// not complete yet; clang looks into functions of std::vector too early when these are constexpr, as they are since
// C++20.
#pragma once

#include <string>

#pragma push_macro("_GLIBCXX20_CONSTEXPR")
#undef _GLIBCXX20_CONSTEXPR
#define _GLIBCXX20_CONSTEXPR
#define __fill_a1 __fill_a1_of_bits  // was declared constexpr above
#include <vector>
#undef __fill_a1
#pragma pop_macro("_GLIBCXX20_CONSTEXPR")

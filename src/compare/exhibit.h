#pragma once
/// The pictures of a report: what the cells of one seed left, beside the input and the truth.

#include <filesystem>
#include <span>

#include "src/compare/methods.h"
#include "src/compare/report.h"
#include "src/compare/subject.h"

namespace cnerf::compare {

/// @param stage2  as configured  @param cells  folder of a capture's seed
[[nodiscard]] ReportCapture exhibit(const Subject& subject, std::span<const Method* const> methods,
                                    const Stage2Options& stage2, const std::filesystem::path& cells);

/// The first shown view by every method beside the input and the truth as one PNG, for documents.
void write_strip(const Subject& subject, std::span<const Method* const> methods, const std::filesystem::path& cells,
                 const std::filesystem::path& file);

}  // namespace cnerf::compare

#pragma once
/// Many runs side by side: what each of them measured.

#include <filesystem>
#include <vector>

#include "src/base/observer.h"

namespace cnerf::pipeline {

/// Writes table.md, table.json and contact_sheet.png of runs to a folder. A run that is not finished, or was not
/// evaluated, has a row that says so.
/// @return  how many runs are finished
/// @throws UsageError  no run among the folders  @throws InputError, SnapshotError, OutputError
int report_runs(const std::vector<std::filesystem::path>& folders, const std::filesystem::path& out,
                Observer& observer);

}  // namespace cnerf::pipeline

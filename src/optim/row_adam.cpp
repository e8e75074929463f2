#include "src/optim/row_adam.h"

namespace cnerf {

void update_rows(const TableRows& rows, const AdamStep& step, float decay) {
  const float kept = step.kept(decay);
  for (std::size_t r = 0; r < rows.count; ++r) {
    float* d = rows.gradient + 4 * r;
    if (d[0] == 0 && d[1] == 0 && d[2] == 0 && d[3] == 0) continue;
    float* first = rows.moments + 8 * r;
    float* second = first + 4;
    float* value = rows.values + 4 * r;
    for (int f = 0; f < 4; ++f) {
      step.apply(d[f], first[f], second[f], value[f], kept);
      d[f] = 0;
    }
  }
}

}  // namespace cnerf

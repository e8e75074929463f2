/// The Python module `cnerf`: what its __init__.py takes its names from.

#include "src/base/parallel.h"
#include "src/pipeline/version.h"
#include "src/python/bindings.h"

PYBIND11_MODULE(_cnerf, module) {
  using namespace cnerf::python;
  module.attr("__version__") = cnerf::pipeline::version_text();
  module.def(
      "set_threads", [](int threads) { cnerf::set_thread_count(threads); }, pybind11::arg("threads"),
      "Sets how many threads are used; 0 = all cores.");
  bind_errors(module);
  bind_cameras(module);
  bind_fields(module);
  bind_runs(module);
}

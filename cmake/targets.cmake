include(GNUInstallDirs)

# cnerf_add_library(NAME SOURCES … [PUBLIC …] [PRIVATE …])
# One static library a folder; headers are included by their path from the root.
function(cnerf_add_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(${name} STATIC ${arg_SOURCES})
  target_include_directories(${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PUBLIC ${arg_PUBLIC} PRIVATE cnerf_options ${arg_PRIVATE})
endfunction()

# cnerf_add_test(NAME SOURCES … LINK … [LABELS …] [TIMEOUT seconds])
# One executable of GoogleTest cases; every case is a CTest test of its own.
function(cnerf_add_test name)
  cmake_parse_arguments(arg "" "TIMEOUT" "SOURCES;LINK;LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  if(NOT arg_LABELS)
    set(arg_LABELS unit)
  endif()
  add_executable(${name} ${arg_SOURCES})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE cnerf_options cnerf_test_support ${arg_LINK})
  # Torch takes seconds to load on a busy machine.
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60
    PROPERTIES LABELS "${arg_LABELS}" TIMEOUT ${arg_TIMEOUT})
endfunction()

# cnerf_compile_per_isa(GENERIC AVX2 AVX512): instruction sets of three files that include one kernel text.
# No contraction: an fma stands where the source says fma, so that back ends can be compared bit by bit.
function(cnerf_compile_per_isa generic avx2 avx512)
  set(common -O3 -fno-math-errno -fno-trapping-math -ffp-contract=off)
  set_source_files_properties(${generic} PROPERTIES COMPILE_OPTIONS "${common}")
  set_source_files_properties(${avx2} PROPERTIES COMPILE_OPTIONS "${common};-mavx2;-mfma;-mtune=haswell")
  set_source_files_properties(${avx512} PROPERTIES
    COMPILE_OPTIONS "${common};-mavx512f;-mavx512dq;-mavx512vl;-mavx512bw;-mfma;-mtune=znver3;-Wno-uninitialized")  # GCC 105593
endfunction()

# cnerf_add_cuda_library(NAME SOURCES … [PUBLIC …]): like cnerf_add_library, of kernels and their launchers.
function(cnerf_add_cuda_library name)
  cnerf_add_library(${name} ${ARGN})
  cnerf_enable_cuda(${name})
endfunction()

# cnerf_enable_cuda(NAME): for a library of ours that has kernels beside other sources.
function(cnerf_enable_cuda name)
  target_compile_options(${name} PRIVATE $<$<COMPILE_LANGUAGE:CUDA>:--expt-relaxed-constexpr>)
  target_link_libraries(${name} PUBLIC CUDA::cudart_static)
endfunction()

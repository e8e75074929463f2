include(GNUInstallDirs)

# Where programs look for their parts when these are not beside them: in the build tree, or where a package puts them.
# A package's program names no folder of the machine that built it. Plug-ins, data: src/base/plugin.h.
set(CNERF_BUILT_DATA ${PROJECT_BINARY_DIR}/share/cnerf)
if(CNERF_PACKAGE)
  set(CNERF_PLUGIN_HOME ${CMAKE_INSTALL_PREFIX}/lib/cnerf)
  set(CNERF_DATA_HOME ${CMAKE_INSTALL_PREFIX}/share/cnerf)
else()
  set(CNERF_PLUGIN_HOME ${PROJECT_BINARY_DIR})
  set(CNERF_DATA_HOME ${CNERF_BUILT_DATA})
endif()

set(CNERF_PYTHON_FOLDER lib/python3/dist-packages/cnerf)  # of the Python module; Debian's interpreter looks there

# cnerf_keep_data(NAME PATH): a file or folder of the sources that programs read, installed as share/cnerf/NAME.
function(cnerf_keep_data name path)
  file(MAKE_DIRECTORY ${CNERF_BUILT_DATA})
  file(CREATE_LINK ${path} ${CNERF_BUILT_DATA}/${name} SYMBOLIC)
  if(IS_DIRECTORY ${path})
    install(DIRECTORY ${path}/ DESTINATION share/cnerf/${name})
  else()
    install(FILES ${path} DESTINATION share/cnerf)
  endif()
endfunction()

# cnerf_add_library(NAME SOURCES … [PUBLIC …] [PRIVATE …])
# One static library a folder; headers are included by their path from the root.
function(cnerf_add_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(${name} STATIC ${arg_SOURCES})
  target_include_directories(${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:include/cnerf>)
  target_link_libraries(${name} PUBLIC ${arg_PUBLIC} PRIVATE cnerf_options ${arg_PRIVATE})
  if("torch" IN_LIST arg_PUBLIC OR "torch" IN_LIST arg_PRIVATE)
    # Once all its sources are known. A deferred call sees variables of then, so the name has to be written out.
    cmake_language(EVAL CODE "cmake_language(DEFER CALL cnerf_precompile_torch ${name})")
  endif()
endfunction()

# cnerf_suites_of(OUT sources …): the GoogleTest suites of these sources, read from their text: configuring runs no test.
function(cnerf_suites_of out)
  set(suites "")
  foreach(source ${ARGN})
    get_filename_component(file ${source} ABSOLUTE)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
    file(READ ${file} text)
    string(REGEX MATCHALL "(^|\n)(TEST|TEST_F|TEST_P|TYPED_TEST)\\([ \n]*[A-Za-z0-9_]+" found "${text}")
    list(TRANSFORM found REPLACE "^[^(]*\\([ \n]*" "")
    list(APPEND suites ${found})
  endforeach()
  list(REMOVE_DUPLICATES suites)
  set(${out} ${suites} PARENT_SCOPE)
endfunction()

# cnerf_add_plugin(NAME SOURCES … LINK …)
# A part of the program that is loaded when it is needed: libNAME.so, see src/base/plugin.h.
set(CNERF_PLUGIN_FOLDER ${PROJECT_BINARY_DIR})
function(cnerf_add_plugin name)
  cmake_parse_arguments(arg "" "" "SOURCES;LINK" ${ARGN})
  add_library(${name} MODULE ${arg_SOURCES})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE cnerf_options ${arg_LINK})
  if(NOT CNERF_FUZZ)  # clang leaves the sanitizers to the program
    target_link_options(${name} PRIVATE LINKER:-z,defs)  # what the program lacks must not be missed at run time
  endif()
  target_link_options(${name} PRIVATE LINKER:--disable-new-dtags)  # as of programs: cmake/packages.cmake
  set_target_properties(${name} PROPERTIES
    LIBRARY_OUTPUT_DIRECTORY ${CNERF_PLUGIN_FOLDER} INSTALL_RPATH $ORIGIN INSTALL_RPATH_USE_LINK_PATH ON)
  install(TARGETS ${name} LIBRARY DESTINATION lib/cnerf)
endfunction()

# cnerf_time_limit(VARIABLE SECONDS)
# How long a test may take: sanitizers make it many times as slow.
function(cnerf_time_limit variable seconds)
  if(CNERF_SANITIZE)
    math(EXPR seconds "4 * ${seconds}")
  endif()
  set(${variable} ${seconds} PARENT_SCOPE)
endfunction()

# cnerf_add_test(NAME SOURCES … LINK … [LABELS …] [TIMEOUT seconds] [COST seconds])
# One executable of GoogleTest cases; every suite of it is a CTest test of its own, NAME.SUITE. A suite that CTest would
# not run fails the others: tests/support/gtest_main.cpp knows the list.
function(cnerf_add_test name)
  cmake_parse_arguments(arg "" "TIMEOUT;COST" "SOURCES;LINK;LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 900)
  endif()
  cnerf_time_limit(arg_TIMEOUT ${arg_TIMEOUT})
  if(NOT arg_LABELS)
    set(arg_LABELS unit)
  endif()
  if(NOT arg_COST)
    set(arg_COST 0)
  endif()
  if(name IN_LIST CNERF_SMOKE_TESTS)
    list(APPEND arg_LABELS smoke)
  endif()
  add_executable(${name} ${arg_SOURCES})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE cnerf_options cnerf_test_support ${arg_LINK})
  if("torch" IN_LIST arg_LINK)
    cnerf_precompile_torch(${name})  # which GCC 14 takes at its own level of optimisation only
  else()
    target_compile_options(${name} PRIVATE ${CNERF_TEST_OPTIMISATION})
    cnerf_precompile_gtest(${name})
  endif()
  cnerf_suites_of(suites ${arg_SOURCES})
  list(JOIN suites ":" all)
  foreach(suite ${suites})
    add_test(NAME ${name}.${suite} COMMAND ${name} --gtest_filter=${suite}.*:*/${suite}.*:${suite}/*.*)
    set_tests_properties(${name}.${suite} PROPERTIES
      LABELS "${arg_LABELS}" TIMEOUT ${arg_TIMEOUT} COST ${arg_COST} SKIP_RETURN_CODE 77
      ENVIRONMENT "CNERF_SUITES=${all};CNERF_CASES=${PROJECT_BINARY_DIR}/Testing/cases/${name}.${suite}")
  endforeach()
endfunction()

# A test runs once and is compiled often.
set(CNERF_TEST_OPTIMISATION $<$<AND:$<CONFIG:Release>,$<COMPILE_LANGUAGE:CXX>>:-O1>)

# cnerf_precompile_gtest(NAME): sources of a test begin with GoogleTest's header and those of std that most tests include.
function(cnerf_precompile_gtest name)
  if(NOT TARGET cnerf_gtest_header)
    file(GENERATE OUTPUT ${PROJECT_BINARY_DIR}/gtest_header.cpp CONTENT "int main() {}  // holds the precompiled header\n")
    add_executable(cnerf_gtest_header ${PROJECT_BINARY_DIR}/gtest_header.cpp)  # an executable, for -fPIE
    target_link_libraries(cnerf_gtest_header PRIVATE cnerf_options GTest::gmock)
    target_precompile_headers(cnerf_gtest_header PRIVATE <gmock/gmock.h> <gtest/gtest.h>
      <algorithm> <array> <cmath> <filesystem> <fstream> <functional> <map> <numeric> <random> <span> <sstream> <string> <vector>)
    target_compile_options(cnerf_gtest_header PRIVATE ${CNERF_TEST_OPTIMISATION} ${CNERF_PRECOMPILED_OPTIONS})
  endif()
  target_compile_options(${name} PRIVATE ${CNERF_PRECOMPILED_OPTIONS})
  target_precompile_headers(${name} REUSE_FROM cnerf_gtest_header)
endfunction()

# cnerf_includes_torch(OUT FILE): whether a file includes <torch/…>, itself or by a header of ours.
function(cnerf_includes_torch out file)
  get_property(known GLOBAL PROPERTY cnerf_torch_of_${file} SET)
  if(NOT known)
    set(answer FALSE)
    set_property(GLOBAL PROPERTY cnerf_torch_of_${file} ${answer})  # ends circles
    set(lines "")
    if(EXISTS ${file})
      file(STRINGS ${file} lines REGEX "^#include [<\"](torch|src|tests|encoding)/")
    endif()
    foreach(line ${lines})
      string(REGEX REPLACE "^#include [<\"]([^>\"]+).*" "\\1" header "${line}")
      if(header MATCHES "^torch/")
        set(answer TRUE)
      elseif(NOT answer)
        cnerf_includes_torch(answer ${PROJECT_SOURCE_DIR}/${header})
      endif()
    endforeach()
    set_property(GLOBAL PROPERTY cnerf_torch_of_${file} ${answer})
  endif()
  get_property(answer GLOBAL PROPERTY cnerf_torch_of_${file})
  set(${out} ${answer} PARENT_SCOPE)
endfunction()

# cnerf_precompile_torch(NAME): sources of NAME that include LibTorch begin with its header, which is compiled once for all
# of them; it takes longer than everything else in them.
function(cnerf_precompile_torch name)
  if(NOT TARGET cnerf_torch_header)
    file(GENERATE OUTPUT ${PROJECT_BINARY_DIR}/torch_header.cpp CONTENT "// Holds the precompiled header.\n")
    add_library(cnerf_torch_header OBJECT ${PROJECT_BINARY_DIR}/torch_header.cpp)
    target_link_libraries(cnerf_torch_header PRIVATE cnerf_options ${TORCH_LIBRARIES})
    target_precompile_headers(cnerf_torch_header PRIVATE <torch/torch.h>)
    target_compile_options(cnerf_torch_header PRIVATE ${CNERF_PRECOMPILED_OPTIONS})
  endif()
  get_target_property(sources ${name} SOURCES)
  foreach(source ${sources})
    get_filename_component(file ${source} ABSOLUTE)
    cnerf_includes_torch(is_torch ${file})
    if(NOT is_torch)
      set_source_files_properties(${source} PROPERTIES SKIP_PRECOMPILE_HEADERS ON SKIP_UNITY_BUILD_INCLUSION ON)
    endif()
  endforeach()
  # GCC 12 forgets that what it inlines from a precompiled header is the system's (GCC 105329, 105651).
  target_compile_options(${name} PRIVATE ${CNERF_PRECOMPILED_OPTIONS}
    $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overflow;-Wno-stringop-overread;-Wno-array-bounds;-Wno-maybe-uninitialized>)
  get_target_property(type ${name} TYPE)
  if(type STREQUAL EXECUTABLE)  # -fPIE would not fit the header
    set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
    target_compile_options(${name} PRIVATE -fPIC)
  endif()
  target_precompile_headers(${name} REUSE_FROM cnerf_torch_header)
endfunction()

# cnerf_compile_per_isa(NAME PREFIX): adds to a library the files PREFIX_ISA.cpp, which include one kernel text, for the
# instruction sets of the processor's family. Of x86-64 further sets can be named.
# No contraction: an fma stands where the source says fma, so that back ends can be compared bit by bit.
function(cnerf_compile_per_isa name prefix)
  set(options_generic "")
  set(options_neon "")
  set(options_avx2 -mavx2 -mfma -mtune=haswell)
  set(options_avx512 -mavx512f -mavx512dq -mavx512vl -mavx512bw -mfma -mtune=haswell -Wno-uninitialized)  # GCC 105593
  set(options_avx512bf16 ${options_avx512} -mavx512bf16)
  set(sets generic avx2 avx512 ${ARGN})
  if(CMAKE_SYSTEM_PROCESSOR STREQUAL "aarch64")
    set(sets generic neon)
  endif()
  foreach(set ${sets})
    target_sources(${name} PRIVATE ${prefix}_${set}.cpp)
    set_source_files_properties(${prefix}_${set}.cpp PROPERTIES
      COMPILE_OPTIONS "-O3;-fno-math-errno;-fno-trapping-math;-ffp-contract=off;${options_${set}}")
  endforeach()
endfunction()

# cnerf_add_cuda_library(NAME SOURCES … [PUBLIC …]): like cnerf_add_library, of kernels and their launchers.
function(cnerf_add_cuda_library name)
  cnerf_add_library(${name} ${ARGN})
  cnerf_enable_cuda(${name})
endfunction()

# cnerf_enable_cuda(NAME): for a library of ours that has kernels beside other sources.
function(cnerf_enable_cuda name)
  target_compile_options(${name} PRIVATE $<$<COMPILE_LANGUAGE:CUDA>:--expt-relaxed-constexpr>)
  if(CNERF_PACKAGE)  # nvcc gives whole paths to __FILE__, which would stand in the package
    target_compile_options(${name} PRIVATE $<$<COMPILE_LANGUAGE:CUDA>:-Xcompiler=-fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=>)
  endif()
  target_link_libraries(${name} PUBLIC CUDA::cudart_static)
endfunction()

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()

find_program(CNERF_CCACHE ccache)
if(CNERF_CCACHE)
  # ccache stores what begins with a precompiled header only if it is told that this is meant.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CNERF_CCACHE})
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    set(CNERF_PRECOMPILED_OPTIONS -fpch-preprocess)  # ccache wants it with precompiled headers
  endif()
endif()

# Every target of ours links this one; packages' headers are SYSTEM and stay out of it.
add_library(cnerf_options INTERFACE)
target_compile_options(cnerf_options INTERFACE
                       # Nobody looks at errno or at traps of numbers: the same numbers, from vector instructions.
                       $<$<COMPILE_LANGUAGE:CXX>:-fno-math-errno;-fno-trapping-math>
                       $<$<COMPILE_LANGUAGE:CXX>:-Wall;-Wextra;-Wshadow;-Wnon-virtual-dtor;-Woverloaded-virtual>
                       $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<CXX_COMPILER_ID:GNU>,$<VERSION_LESS:$<CXX_COMPILER_VERSION>,13>>:-Wno-restrict>  # GCC 105329
                       # Of sources that are compiled as one none is the main file.
                       $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<CXX_COMPILER_ID:GNU>,$<BOOL:$<TARGET_PROPERTY:UNITY_BUILD>>>:-Wno-subobject-linkage>
                       # Takes what a function returns for what it was given (GCC 107532).
                       $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<CXX_COMPILER_ID:GNU>,$<NOT:$<VERSION_LESS:$<CXX_COMPILER_VERSION>,13>>>:-Wno-dangling-reference>)
if(CNERF_WARNINGS_AS_ERRORS)
  target_compile_options(cnerf_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-Werror>)
endif()
if(CNERF_PACKAGE)  # checks name their source file, without the folder it was compiled in
  target_compile_options(cnerf_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=>)
endif()
if(CNERF_SANITIZE)
  # GCC takes what a sanitizer adds for uninitialised (GCC 105562).
  target_compile_options(cnerf_options INTERFACE
                         $<$<COMPILE_LANGUAGE:CXX>:-fsanitize=${CNERF_SANITIZE};-fno-omit-frame-pointer;-Wno-maybe-uninitialized>)
  target_link_options(cnerf_options INTERFACE -fsanitize=${CNERF_SANITIZE})
  if(CNERF_SANITIZE MATCHES undefined)
    # A check of dynamic types would need OpenCV's video classes, which only a plug-in links.
    target_compile_options(cnerf_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-fno-sanitize=vptr>)
  endif()
endif()

if(CNERF_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "CNERF_FUZZ needs libFuzzer: configure with -DCMAKE_CXX_COMPILER=clang++")
  endif()
  # Counts of edges in everything of ours; the fuzzer's own main is linked by the targets of tests/fuzz alone.
  set(fuzz_sanitizers address,undefined,float-cast-overflow)
  target_compile_options(cnerf_options INTERFACE
    $<$<COMPILE_LANGUAGE:CXX>:-fsanitize=fuzzer-no-link,${fuzz_sanitizers};-fno-sanitize-recover=all;-fno-omit-frame-pointer>)
  target_link_options(cnerf_options INTERFACE -fsanitize=${fuzz_sanitizers})
endif()

if(CNERF_CUDA)
  enable_language(CUDA)
  if(CMAKE_CUDA_COMPILER_VERSION VERSION_LESS 12)
    message(FATAL_ERROR "CNERF_CUDA needs nvcc 12 or later, which knows C++20: found ${CMAKE_CUDA_COMPILER_VERSION}")
  endif()
  if(NOT CMAKE_CUDA20_STANDARD_COMPILE_OPTION)  # CMake before 3.26 does not know nvcc's C++20
    set(CMAKE_CUDA20_STANDARD_COMPILE_OPTION "-std=c++20")
  endif()
  set(CMAKE_CUDA_STANDARD 20)
  set(CMAKE_CUDA_EXTENSIONS OFF)
  set(CMAKE_CUDA_RUNTIME_LIBRARY Static)  # nothing but a driver is needed to run
  find_package(CUDAToolkit REQUIRED)
endif()

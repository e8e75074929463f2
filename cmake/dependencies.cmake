# Packages of the system; scripts/install_dependencies.sh has their Debian names.
include(${CMAKE_CURRENT_LIST_DIR}/library_dependencies.cmake)

if(CNERF_TORCH)
  find_package(Torch REQUIRED)
endif()
# PyTorch's builds of LibTorch export a std::filesystem of their own (seen with 2.11). The system's C++ library has to
# come before them, or its objects are freed by their code.
if(TARGET torch AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_link_options(torch INTERFACE "LINKER:--push-state,--no-as-needed,-lstdc++,--pop-state")
endif()

# OpenVDB's library holds the common grids. Where they can be linked they are not compiled again. Sanitizers are the
# exception: they look into what is compiled.
if(NOT CNERF_SANITIZE AND NOT CNERF_FUZZ)
  set(CMAKE_TRY_COMPILE_CONFIGURATION ${CMAKE_BUILD_TYPE})
  try_compile(CNERF_OPENVDB_HAS_GRIDS ${PROJECT_BINARY_DIR}/openvdb_grids SOURCES ${PROJECT_SOURCE_DIR}/cmake/openvdb_grids.cpp
    CMAKE_FLAGS -DINCLUDE_DIRECTORIES=${PROJECT_SOURCE_DIR} LINK_LIBRARIES OpenVDB::openvdb CXX_STANDARD 20)
  unset(CMAKE_TRY_COMPILE_CONFIGURATION)
  target_compile_definitions(OpenVDB::openvdb INTERFACE CNERF_OPENVDB_HAS_GRIDS=$<BOOL:${CNERF_OPENVDB_HAS_GRIDS}>)
endif()

if(CNERF_TESTS)
  find_package(GTest REQUIRED)
endif()

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

if(CNERF_TESTS)
  find_package(GTest REQUIRED)
endif()

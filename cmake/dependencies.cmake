# Packages of the system; see README.md for their Debian names.
find_package(Threads REQUIRED)
find_package(TBB REQUIRED)
find_package(OpenSSL REQUIRED COMPONENTS Crypto)
find_package(ZLIB REQUIRED)
find_package(fmt REQUIRED)
find_package(spdlog REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(tomlplusplus REQUIRED)
find_package(CLI11 REQUIRED)
find_package(pugixml REQUIRED)
find_package(OpenCV REQUIRED COMPONENTS core dnn imgcodecs imgproc videoio video calib3d features2d)
find_package(Imath REQUIRED)
find_package(OpenEXR REQUIRED)
find_package(meshoptimizer REQUIRED)
find_package(TinyGLTF REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(httplib REQUIRED IMPORTED_TARGET cpp-httplib)
pkg_check_modules(exif REQUIRED IMPORTED_TARGET libexif)

# OpenVDB ships a find module instead of a config package, and needs Boost iostreams.
list(APPEND CMAKE_MODULE_PATH /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/OpenVDB
     /usr/lib/x86_64-linux-gnu/cmake/OpenVDB)
find_package(Boost REQUIRED COMPONENTS iostreams)
find_package(OpenVDB REQUIRED)

find_package(Torch REQUIRED)
# PyTorch's builds of LibTorch export a std::filesystem of their own (seen with 2.11). The system's C++ library has to
# come before them, or its objects are freed by their code.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_link_options(torch INTERFACE "LINKER:--push-state,--no-as-needed,-lstdc++,--pop-state")
endif()

if(CNERF_TESTS)
  find_package(GTest REQUIRED)
endif()

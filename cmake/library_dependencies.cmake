# Packages of the system that the library needs, and what is built with it: also read by cnerfConfig.cmake.
find_package(Threads REQUIRED)
find_package(TBB REQUIRED)
find_package(OpenSSL REQUIRED COMPONENTS Crypto)
find_package(Eigen3 REQUIRED)
# Ceres as shared libraries, with what its headers log by: its package for CMake names the static one.
find_library(CERES_LIBRARY ceres REQUIRED)
find_library(GLOG_LIBRARY glog REQUIRED)
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

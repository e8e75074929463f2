# Packages by CPack, which scripts/package.sh calls: cnerf, libcnerf-dev and python3-cnerf for Debian, and an archive for other machines.
set(CPACK_PACKAGE_NAME cnerf)
string(TOLOWER ${CMAKE_SYSTEM_NAME}-${CMAKE_SYSTEM_PROCESSOR} machine)
set(CPACK_PACKAGE_FILE_NAME cnerf-${PROJECT_VERSION}-${machine})
set(CPACK_PACKAGE_CONTACT "The cnerf developers <developers@cnerf.invalid>")  # no address yet; Debian wants the form
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_STRIP_FILES ON)
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_PROJECT_CONFIG_FILE ${PROJECT_SOURCE_DIR}/cmake/package_kinds.cmake)

# Debian 12 and 13 link other versions of the same libraries, so that the packages' versions tell them apart.
cmake_host_system_information(RESULT debian QUERY DISTRIB_VERSION_ID)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1~deb${debian})

# Debian's policy wants these names, and changelogs compressed without a date: ours, and one of the packaging.
install(FILES cmake/debian_copyright DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright)
install(FILES cmake/lintian_overrides DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/lintian/overrides RENAME cnerf)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT libraries EXCLUDE_FROM_ALL)  # not every system has it
find_program(CNERF_GZIP gzip REQUIRED)
set(changelog ${PROJECT_BINARY_DIR}/changelog.gz)
set(changelog_of_packaging ${PROJECT_BINARY_DIR}/changelog.Debian.gz)
add_custom_command(OUTPUT ${changelog} COMMAND ${CNERF_GZIP} -9nc ${PROJECT_SOURCE_DIR}/CHANGELOG.md > ${changelog}
  DEPENDS CHANGELOG.md)
string(TIMESTAMP now "%a, %d %b %Y %H:%M:%S +0000" UTC)  # of SOURCE_DATE_EPOCH where that is set
file(WRITE ${PROJECT_BINARY_DIR}/changelog.Debian "cnerf (${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE}) unstable; urgency=medium

  * What changed stands in changelog.gz.

 -- ${CPACK_PACKAGE_CONTACT}  ${now}
")
add_custom_command(OUTPUT ${changelog_of_packaging}
  COMMAND ${CNERF_GZIP} -9nc ${PROJECT_BINARY_DIR}/changelog.Debian > ${changelog_of_packaging}
  DEPENDS ${PROJECT_BINARY_DIR}/changelog.Debian)
add_custom_target(cnerf_changelog ALL DEPENDS ${changelog} ${changelog_of_packaging})
install(FILES ${changelog} ${changelog_of_packaging} DESTINATION ${CMAKE_INSTALL_DOCDIR})
set(others dev:libcnerf-dev)
if(CNERF_PYTHON)
  list(APPEND others python:python3-cnerf)
endif()
foreach(other ${others})
  string(REGEX MATCH "^(.*):(.*)$" parts ${other})
  set(component ${CMAKE_MATCH_1})
  set(folder ${CMAKE_INSTALL_DATAROOTDIR}/doc/${CMAKE_MATCH_2})
  install(FILES cmake/debian_copyright DESTINATION ${folder} RENAME copyright COMPONENT ${component})
  install(FILES ${changelog} ${changelog_of_packaging} DESTINATION ${folder} COMPONENT ${component})
endforeach()

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME cnerf)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION graphics)
# LibTorch runs on any BLAS; on the reference one colorizers are fitted many times slower.
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS "libopenblas0-pthread")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "colmap, blender")
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION
    "Colour volumes from monochrome photographs or film clips\nThe program, its page for browsers, its presets\nand the weights of its colorizer.")
set(CPACK_DEBIAN_DEV_PACKAGE_NAME libcnerf-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS
    "cnerf (= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE}), libtbb-dev, libceres-dev, libssl-dev, zlib1g-dev, libfmt-dev, libspdlog-dev, nlohmann-json3-dev, libtomlplusplus-dev, libcli11-dev, libpugixml-dev, libopencv-dev, libopenexr-dev, libmeshoptimizer-dev, libtinygltf-dev, libcpp-httplib-dev, libexif-dev, libboost-iostreams-dev, libopenvdb-dev, pkg-config")
set(CPACK_COMPONENT_DEV_DESCRIPTION "Library of cnerf\nStatic libraries, headers and the CMake package cnerf.")

if(CNERF_PYTHON)
  # A module fits one minor version of Python.
  math(EXPR next "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-cnerf)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
      "cnerf (= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE}), python3 (>= 3.${Python_VERSION_MINOR}), python3 (<< 3.${next}), python3-numpy")
  set(CPACK_COMPONENT_PYTHON_DESCRIPTION "Python module for cnerf\nRuns and bakes with NumPy arrays, and the steps that make them.")
endif()

# What the archive holds beside the program: the shared libraries it links, without the C library and a GPU's driver.
# Programs, plug-ins and the Python module have an RPATH rather than a RUNPATH, so that these libraries find each other too.
set(plugins "")
foreach(name cnerf_images cnerf_videos cnerf_torch cnerf_compare_torch cnerf_onnxruntime cnerf_cluster_plugin)
  if(TARGET ${name})
    list(APPEND plugins ${name})
  endif()
endforeach()
list(TRANSFORM plugins REPLACE "(.+)" "\"$<TARGET_FILE:\\1>\"")
list(JOIN plugins " " plugins)
install(CODE "
  file(GET_RUNTIME_DEPENDENCIES RESOLVED_DEPENDENCIES_VAR found
    EXECUTABLES \"$<TARGET_FILE:cnerf>\" \"$<TARGET_FILE:cnerf-vdb-reader>\"
    MODULES ${plugins}
    POST_EXCLUDE_REGEXES [[/(ld-linux-x86-64|libc|libm|libmvec|libdl|librt|libpthread|libresolv|libutil|libcuda|libnvidia-[-a-z]+)\\.so]])
  file(INSTALL \${found} DESTINATION \${CMAKE_INSTALL_PREFIX}/lib/cnerf FOLLOW_SYMLINK_CHAIN)
  # Whose they are, and under which licence.
  execute_process(COMMAND perl \"${PROJECT_SOURCE_DIR}/scripts/bill_of_materials.pl\"
      \"$<TARGET_FILE:cnerf>\" \"$<TARGET_FILE:cnerf-vdb-reader>\" ${plugins}
    OUTPUT_VARIABLE bill COMMAND_ERROR_IS_FATAL ANY)
  string(JSON last LENGTH \"\${bill}\" packages)
  math(EXPR last \"\${last} - 1\")
  foreach(i RANGE 1 \${last})  # 0 is cnerf
    string(JSON name GET \"\${bill}\" packages \${i} name)
    file(INSTALL /usr/share/doc/\${name}/copyright
         DESTINATION \${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATAROOTDIR}/doc/\${name})
  endforeach()
" COMPONENT libraries EXCLUDE_FROM_ALL)
include(CPack)

# The library for other projects: find_package(cnerf), link cnerf::cnerf_pipeline (tests/package/consumer does it).

# cnerf_libraries_of(OUT NAME): NAME and the libraries of ours that it links, directly or not.
function(cnerf_libraries_of out name)
  set(found ${${out}} ${name})
  get_target_property(links ${name} LINK_LIBRARIES)
  foreach(link ${links})
    if(link MATCHES "^cnerf_" AND NOT link IN_LIST found)
      cnerf_libraries_of(found ${link})
    endif()
  endforeach()
  set(${out} ${found} PARENT_SCOPE)
endfunction()

set(libraries "")
cnerf_libraries_of(libraries cnerf_pipeline)
set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/cnerf)
install(TARGETS ${libraries} EXPORT cnerf ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev)
install(EXPORT cnerf NAMESPACE cnerf:: FILE cnerfTargets.cmake DESTINATION ${package_folder} COMPONENT dev)

# Headers keep their paths from the root, since they include each other by them.
set(folders "")
foreach(library ${libraries})
  get_target_property(folder ${library} SOURCE_DIR)
  get_target_property(type ${library} TYPE)
  if(NOT type STREQUAL INTERFACE_LIBRARY)
    list(APPEND folders ${folder})
  endif()
endforeach()
list(TRANSFORM folders APPEND /*.h)
file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR} ${folders})
list(FILTER headers EXCLUDE REGEX "/torch/")
list(REMOVE_DUPLICATES headers)
foreach(header ${headers})
  get_filename_component(place ${header} DIRECTORY)
  install(FILES ${header} DESTINATION include/cnerf/${place} COMPONENT dev)
endforeach()

include(CMakePackageConfigHelpers)
configure_file(cmake/cnerfConfig.cmake.in cnerfConfig.cmake @ONLY)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/cnerfConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/cnerfConfig.cmake ${PROJECT_BINARY_DIR}/cnerfConfigVersion.cmake
        cmake/library_dependencies.cmake cmake/exported_symbols.txt
        DESTINATION ${package_folder} COMPONENT dev)

# Read by CPack for each kind of package: a Debian package leaves the libraries to Debian.
set(python ${CPACK_COMPONENTS_ALL})
list(FILTER python INCLUDE REGEX "^python$")  # where it was built
if(CPACK_GENERATOR STREQUAL DEB)
  set(CPACK_COMPONENTS_ALL program dev ${python})
else()
  set(CPACK_COMPONENTS_ALL program libraries ${python})
  set(CPACK_ARCHIVE_COMPONENT_INSTALL ON)
  set(CPACK_COMPONENT_INCLUDE_TOPLEVEL_DIRECTORY ON)
  set(CPACK_COMPONENTS_GROUPING ALL_COMPONENTS_IN_ONE)
endif()

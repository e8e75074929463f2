# The built-in network. Its weights are read from the install tree, or from here when run from a build tree.
target_sources(cnerf_colorizer PRIVATE
  ${CMAKE_CURRENT_LIST_DIR}/builtin_colorizer.cpp
  ${CMAKE_CURRENT_LIST_DIR}/network.cpp
  ${CMAKE_CURRENT_LIST_DIR}/network_decode.cpp
  ${CMAKE_CURRENT_LIST_DIR}/network_weights.cpp)
target_compile_definitions(cnerf_colorizer PRIVATE
  CNERF_HAS_BUILTIN_COLORIZER CNERF_WEIGHTS_FOLDER="${CMAKE_CURRENT_LIST_DIR}/weights")
install(DIRECTORY ${CMAKE_CURRENT_LIST_DIR}/weights/ DESTINATION ${CMAKE_INSTALL_DATADIR}/cnerf)

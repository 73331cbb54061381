# SPDX-License-Identifier: Apache-2.0
# What `cmake --install` puts on a machine: headers, libraries, CMake package, pkg-config files.
include(CMakePackageConfigHelpers)

set(DRIVEID_INSTALLED_LIBRARIES driveid)
if(TARGET driveid_batch)
  list(APPEND DRIVEID_INSTALLED_LIBRARIES driveid_batch)
endif()
set_target_properties(${DRIVEID_INSTALLED_LIBRARIES} PROPERTIES
  VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})

install(TARGETS ${DRIVEID_INSTALLED_LIBRARIES} EXPORT driveid-targets)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/lib/include/driveid DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
install(FILES ${PROJECT_BINARY_DIR}/include/driveid/version.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/driveid)

set(DRIVEID_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/driveid)
install(EXPORT driveid-targets NAMESPACE driveid:: DESTINATION ${DRIVEID_CMAKE_DIR})
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/driveid-config.cmake.in ${PROJECT_BINARY_DIR}/driveid-config.cmake
  INSTALL_DESTINATION ${DRIVEID_CMAKE_DIR} NO_SET_AND_CHECK_MACRO)
# Before 1.0 the minor number is the promise.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/driveid-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/driveid-config.cmake ${PROJECT_BINARY_DIR}/driveid-config-version.cmake DESTINATION ${DRIVEID_CMAKE_DIR})

# pkg-config: paths relative to the file, so that the installed tree can be moved.
file(RELATIVE_PATH DRIVEID_PC_PREFIX /x/${CMAKE_INSTALL_LIBDIR}/pkgconfig /x)
foreach(name driveid driveid-batch)
  if(name STREQUAL driveid OR TARGET driveid_batch)
    configure_file(${PROJECT_SOURCE_DIR}/cmake/${name}.pc.in ${PROJECT_BINARY_DIR}/${name}.pc @ONLY)
    install(FILES ${PROJECT_BINARY_DIR}/${name}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
  endif()
endforeach()

# SPDX-License-Identifier: MIT
# Installs formats and runtime (headers, libraries, the package that find_package(sinew) reads) and, where the tools are
# built, the programs. `cmake --install build/release --component sinew_runtime` installs the MIT part alone.
include(CMakePackageConfigHelpers)

set(sinew_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/sinew)
set(sinew_libraries sinew_formats)
if(TARGET sinew_runtime)
  list(APPEND sinew_libraries sinew_runtime sinew_report sinew_cut)
endif()

foreach(library IN LISTS sinew_libraries)
  # A shared runtime finds the formats library beside it.
  set_target_properties(${library} PROPERTIES
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR} INSTALL_RPATH "$ORIGIN")
endforeach()

install(TARGETS ${sinew_libraries} EXPORT sinewTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT sinew_runtime
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT sinew_runtime
  RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT sinew_runtime)
foreach(layer IN ITEMS formats runtime)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/${layer}/include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT sinew_runtime
    FILES_MATCHING PATTERN "*.h")
endforeach()
install(EXPORT sinewTargets NAMESPACE sinew:: DESTINATION ${sinew_package_dir} COMPONENT sinew_runtime)

configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/sinewConfig.cmake.in ${PROJECT_BINARY_DIR}/sinewConfig.cmake
  INSTALL_DESTINATION ${sinew_package_dir})
# Before 1.0 a minor version may break callers.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/sinewConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/sinewConfig.cmake ${PROJECT_BINARY_DIR}/sinewConfigVersion.cmake
  DESTINATION ${sinew_package_dir} COMPONENT sinew_runtime)

# sinew.pc, for builds without CMake. Its paths start from where it lies, so that an install tree can be moved. The
# libraries that a static one needs are in Libs: there is no shared one beside it that could do without.
set(sinew_pc_dir ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
if(IS_ABSOLUTE ${CMAKE_INSTALL_LIBDIR})
  set(SINEW_PC_PREFIX ${CMAKE_INSTALL_PREFIX})
else()
  file(RELATIVE_PATH sinew_pc_up /${sinew_pc_dir} /)
  string(REGEX REPLACE "/$" "" SINEW_PC_PREFIX "\${pcfiledir}/${sinew_pc_up}")
endif()
foreach(kind IN ITEMS LIB INCLUDE)
  if(IS_ABSOLUTE ${CMAKE_INSTALL_${kind}DIR})
    set(SINEW_PC_${kind}DIR ${CMAKE_INSTALL_${kind}DIR})
  else()
    set(SINEW_PC_${kind}DIR "\${prefix}/${CMAKE_INSTALL_${kind}DIR}")
  endif()
endforeach()
set(SINEW_PC_LIBS -lsinew_runtime)
get_target_property(sinew_runtime_type sinew_runtime TYPE)
if(sinew_runtime_type STREQUAL "STATIC_LIBRARY")
  get_property(cxx_libraries GLOBAL PROPERTY SINEW_RUNTIME_CXX_LIBRARIES)
  list(TRANSFORM cxx_libraries PREPEND -l)
  list(APPEND SINEW_PC_LIBS -lsinew_formats ${cxx_libraries} ${CMAKE_THREAD_LIBS_INIT})
endif()
list(JOIN SINEW_PC_LIBS " " SINEW_PC_LIBS)
set(sinew_parts sinew_cut sinew_report)
set(sinew_part_descriptions "Cutting" "The solver of the report")
configure_file(${PROJECT_SOURCE_DIR}/cmake/sinew.pc.in ${PROJECT_BINARY_DIR}/sinew.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/sinew.pc DESTINATION ${sinew_pc_dir} COMPONENT sinew_runtime)
foreach(part description IN ZIP_LISTS sinew_parts sinew_part_descriptions)
  configure_file(${PROJECT_SOURCE_DIR}/cmake/sinew_part.pc.in ${PROJECT_BINARY_DIR}/${part}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/${part}.pc DESTINATION ${sinew_pc_dir} COMPONENT sinew_runtime)
endforeach()

install(FILES ${PROJECT_SOURCE_DIR}/LICENSE.md ${PROJECT_SOURCE_DIR}/LICENSES/MIT.txt
  DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT sinew_runtime)

# Every program and module the tools build, so that a helper lies beside what opens it.
function(sinew_install_programs directory)
  get_property(targets DIRECTORY ${directory} PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(type ${target} TYPE)
    if(type MATCHES "EXECUTABLE|MODULE_LIBRARY")
      install(TARGETS ${target}
        RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT sinew_tools
        LIBRARY DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT sinew_tools)
    endif()
  endforeach()
  get_property(children DIRECTORY ${directory} PROPERTY SUBDIRECTORIES)
  foreach(child IN LISTS children)
    sinew_install_programs(${child})
  endforeach()
endfunction()
if(SINEW_BUILD_TOOLS)
  sinew_install_programs(${PROJECT_SOURCE_DIR}/tools)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSES/GPL-3.0-or-later.txt DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT sinew_tools)
endif()

# SPDX-License-Identifier: MIT
# sinew_target(NAME): the compile options every target of this project shares.

find_program(SINEW_CCACHE ccache)
if(SINEW_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${SINEW_CCACHE})
endif()

# A first build that no cache helps: templates of Eigen and nlohmann-json are parsed and made once for many files. Not where
# ccache is, which has the results of each file: there a change compiles its own file, and each shows that it includes what it
# names.
set(quick ON)
if(CMAKE_CXX_COMPILER_LAUNCHER)
  set(quick OFF)
endif()
option(SINEW_QUICK_BUILD "All from nothing in less time: common headers precompiled, files of one library compiled together" ${quick})

# sinew_compile_together(TARGET [FILE...]): in a quick build these (no file: all of the target) are one translation unit.
function(sinew_compile_together target)
  if(SINEW_QUICK_BUILD)
    set(files ${ARGN})
    if(NOT files)
      get_target_property(files ${target} SOURCES)
    endif()
    list(GET files 0 group)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
    set_source_files_properties(${files} PROPERTIES UNITY_GROUP ${target}_${group})
  endif()
endfunction()

# A translation unit with CGAL's meshing takes 3 GB to compile: never two of them at once (Ninja only; with another generator
# use -j1 where memory is short).
set_property(GLOBAL APPEND PROPERTY JOB_POOLS sinew_cgal=1)

function(sinew_target name)
  set(with_cgal OFF)
  if(name MATCHES "^sinew_cgal_" OR name STREQUAL "sinew_topology")
    set(with_cgal ON)
    set_target_properties(${name} PROPERTIES JOB_POOL_COMPILE sinew_cgal)
  endif()
  target_compile_features(${name} PUBLIC cxx_std_20)
  # Results are hashed and compared bit for bit, so the compiler may not fuse multiplications and additions on its own.
  target_compile_options(${name} PRIVATE -ffp-contract=off)
  if(NOT SINEW_QUICK_BUILD)
    target_compile_options(${name} PRIVATE
      -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wold-style-cast -Wnon-virtual-dtor -Woverloaded-virtual
      # g++ 12 warns falsely where std::string is put together (GCC bug 105651).
      $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>
      $<$<BOOL:${SINEW_WARNINGS_AS_ERRORS}>:-Werror>)
  else()
    # Across files and precompiled headers g++ 12 warns falsely; where ccache is every warning counts.
    target_compile_options(${name} PRIVATE -w)
    # Memory of units as large as these is taken and kept: g++ else takes a fifth of its time to look what it can give back.
    target_compile_options(${name} PRIVATE $<$<COMPILE_LANG_AND_ID:CXX,GNU>:--param=ggc-min-heapsize=1000000>)
    # Optimizing takes a third of the compilation. The tools spend their time in Eigen's products (field) and in files; CGAL
    # meshes a tenth slower. What games run is optimized as Debian does.
    if(CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
      set(level -O2)
      if(CMAKE_CURRENT_SOURCE_DIR MATCHES "^${PROJECT_SOURCE_DIR}/tools" AND NOT name STREQUAL "sinew_field")
        set(level -O1)
      endif()
      target_compile_options(${name} PRIVATE $<$<CONFIG:Release,RelWithDebInfo>:${level}>)
    endif()
  endif()
  if(SINEW_SANITIZE)
    target_compile_options(${name} PRIVATE -fsanitize=${SINEW_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all
      # g++ 12 sees less through instrumented code and warns falsely about CGAL's and Eigen's; shown, but no error.
      $<$<CXX_COMPILER_ID:GNU>:-Wno-error=maybe-uninitialized>)
    target_link_options(${name} PUBLIC -fsanitize=${SINEW_SANITIZE})
  endif()
  # tools/CMakeLists.txt has the headers. CGAL is compiled for exact rounding.
  if(TARGET sinew_tools_headers AND CMAKE_CURRENT_SOURCE_DIR MATCHES "^${PROJECT_SOURCE_DIR}/tools/" AND NOT with_cgal)
    target_precompile_headers(${name} REUSE_FROM sinew_tools_headers)
  endif()
endfunction()

# SPDX-License-Identifier: MIT
# sinew_target(NAME): the compile options every target of this project shares.

find_program(SINEW_CCACHE ccache)
if(SINEW_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${SINEW_CCACHE})
endif()

# A translation unit with CGAL's meshing takes 3 GB to compile: never two of them at once (Ninja only; with another generator
# use -j1 where memory is short).
set_property(GLOBAL APPEND PROPERTY JOB_POOLS sinew_cgal=1)

function(sinew_target name)
  if(name MATCHES "^sinew_cgal_" OR name STREQUAL "sinew_topology")
    set_target_properties(${name} PROPERTIES JOB_POOL_COMPILE sinew_cgal)
  endif()
  target_compile_features(${name} PUBLIC cxx_std_20)
  target_compile_options(${name} PRIVATE
    -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wold-style-cast -Wnon-virtual-dtor -Woverloaded-virtual
    # g++ 12 warns falsely where std::string is put together (GCC bug 105651).
    $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>
    # Results are hashed and compared bit for bit, so the compiler may not fuse multiplications and additions on its own.
    -ffp-contract=off
    $<$<BOOL:${SINEW_WARNINGS_AS_ERRORS}>:-Werror>)
  if(SINEW_SANITIZE)
    target_compile_options(${name} PRIVATE -fsanitize=${SINEW_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all
      # g++ 12 sees less through instrumented code and warns falsely about CGAL's and Eigen's; shown, but no error.
      $<$<CXX_COMPILER_ID:GNU>:-Wno-error=maybe-uninitialized>)
    target_link_options(${name} PUBLIC -fsanitize=${SINEW_SANITIZE})
  endif()
endfunction()

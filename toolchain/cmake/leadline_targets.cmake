# How every target of the project is compiled. Included once by the root CMakeLists.txt.
#
#   leadline_vehicle_library(NAME [FOLDER...])   static library of vehicle code from the current folder,
#                                    or from these folders below it and the headers beside them
#   leadline_host_target(TARGET)     flags for host programs, libraries and tests

set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)  # clang-tidy reads it

# CMake's own -O3 for Release would hide which folders ask for it; each asks for itself below.
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")

if(LEADLINE_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  find_program(LEADLINE_CCACHE_PROGRAM ccache)
  mark_as_advanced(LEADLINE_CCACHE_PROGRAM)
  if(LEADLINE_CCACHE_PROGRAM)
    set(CMAKE_CXX_COMPILER_LAUNCHER ${LEADLINE_CCACHE_PROGRAM})
  endif()
endif()

# Flags of everything that is ours.
add_library(leadline_flags INTERFACE)
target_include_directories(leadline_flags INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_options(leadline_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Wold-style-cast -Wcast-align
  -Woverloaded-virtual -Wformat=2 -Wundef -Wvla
  $<$<BOOL:${LEADLINE_WARNINGS_AS_ERRORS}>:-Werror>
  # No product may depend on where it was built (log texts, assert texts, hashes of binaries).
  -ffile-prefix-map=${PROJECT_SOURCE_DIR}/=)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(leadline_flags INTERFACE -Wduplicated-cond -Wlogical-op)
endif()

if(CMAKE_SYSTEM_NAME STREQUAL "Linux" AND CMAKE_SIZEOF_VOID_P EQUAL 4)
  # Logs are longer than 2 GiB. (Not so for time: libgpiod's structures have the short one.)
  target_compile_definitions(leadline_flags INTERFACE _FILE_OFFSET_BITS=64)
endif()

if(CMAKE_BUILD_TYPE STREQUAL "Debug")
  target_compile_definitions(leadline_flags INTERFACE _GLIBCXX_ASSERTIONS)
endif()

if(LEADLINE_SCALAR_KERNELS)
  target_compile_definitions(leadline_flags INTERFACE LEADLINE_SCALAR_KERNELS)
endif()

if(LEADLINE_SANITIZE)
  # float-cast-overflow: not part of "undefined", and the way a wild decimal becomes a wild integer.
  set(sanitizers -fsanitize=address,undefined,float-cast-overflow)
  add_compile_options(${sanitizers} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  add_link_options(${sanitizers})
endif()
if(LEADLINE_COVERAGE)
  # Everywhere, though only vehicle code is reported: an inline function of its headers runs wherever the
  # linker found it. Not in headers of others: counted, Eigen takes the navigation filter's tests 30 times as long.
  add_compile_options(--coverage -fprofile-exclude-files=^/usr/)
  add_link_options(--coverage)
endif()
if(LEADLINE_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "libFuzzer comes with clang: cmake --preset fuzz")
  endif()
  # Everything reports its branches to the fuzzer; its main() only goes into the targets.
  add_compile_options(-fsanitize=fuzzer-no-link)
  add_link_options(-fsanitize=fuzzer-no-link)
endif()

# Vehicle code: no exceptions, no RTTI, no silent change of value. -ffp-contract=off: where the
# estimator computes in floating point, a fused multiply-add on one machine and none on another
# would give other bits.
add_library(leadline_vehicle_flags INTERFACE)
target_link_libraries(leadline_vehicle_flags INTERFACE leadline_flags)
target_compile_options(leadline_vehicle_flags INTERFACE
  -fno-exceptions -fno-rtti -ffp-contract=off
  -Wconversion -Wdouble-promotion -Wfloat-conversion -Wfloat-equal -Wswitch-enum)

# Host code: tables are computed here, and their bytes must be the same on every host, hence the
# same rule for contraction.
add_library(leadline_host_flags INTERFACE)
target_link_libraries(leadline_host_flags INTERFACE leadline_flags)
target_compile_options(leadline_host_flags INTERFACE -ffp-contract=off -Wconversion)

if(CMAKE_SYSTEM_NAME STREQUAL "Generic")
  # errno would be state of the C library; guards of static objects and unwinding tables are for threads and
  # exceptions that are not there. Frame sizes and calls: toolchain/stack_check.py reads them.
  target_compile_options(leadline_vehicle_flags INTERFACE
    -fno-math-errno -fno-threadsafe-statics -fno-unwind-tables -fno-asynchronous-unwind-tables
    -fstack-usage -fcallgraph-info=su)
endif()

function(leadline_vehicle_library name)
  if(ARGN)
    file(GLOB headers CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.hpp)
    set(folders ${ARGN})
    list(TRANSFORM folders PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
  else()
    set(folders ${CMAKE_CURRENT_SOURCE_DIR})
  endif()
  foreach(folder IN LISTS folders)
    file(GLOB_RECURSE folder_sources CONFIGURE_DEPENDS ${folder}/*.cpp)
    file(GLOB_RECURSE folder_headers CONFIGURE_DEPENDS ${folder}/*.hpp ${folder}/*.h)
    list(APPEND sources ${folder_sources})
    list(APPEND headers ${folder_headers})
  endforeach()
  add_library(${name} STATIC ${sources})
  # As a header set: the target all_verify_interface_header_sets (toolchain/test.sh --tier ci)
  # compiles each header alone.
  target_sources(${name} PUBLIC FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${headers})
  target_include_directories(${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE leadline_vehicle_flags)
  set_target_properties(${name} PROPERTIES VERIFY_INTERFACE_HEADER_SETS ON)
  add_dependencies(${name} house_check)
endfunction()

function(leadline_host_target target)
  target_include_directories(${target} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(${target} PRIVATE leadline_host_flags)
endfunction()

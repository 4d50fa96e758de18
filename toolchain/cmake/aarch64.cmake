# 64-bit ARM Linux, as Debian's arm64. With LEADLINE_SYSROOT (toolchain/sysroot.sh arm64) libraries come from there;
# without it only what needs none can be built (LEADLINE_PARTS=replay), linked statically.
set(leadline_triplet aarch64-linux-gnu)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(leadline_debian_architecture arm64)
set(leadline_emulator qemu-aarch64-static)
include(${CMAKE_CURRENT_LIST_DIR}/debian_cross.cmake)

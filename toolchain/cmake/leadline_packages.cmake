# Debian packages (toolchain/package.sh): leadline-vehicle, and of a whole build leadline. Included once, at the end of the root
# CMakeLists.txt.
include(GNUInstallDirs)
set(packaging ${PROJECT_SOURCE_DIR}/toolchain/packaging)

install(TARGETS leadline-vehicle leadline-replay
  RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT vehicle)
install(FILES ${packaging}/leadline-vehicle.service
  DESTINATION /usr/lib/systemd/system COMPONENT vehicle)
install(FILES ${packaging}/70-leadline.rules
  DESTINATION /usr/lib/udev/rules.d COMPONENT vehicle)
install(FILES ${PROJECT_SOURCE_DIR}/firmware/README.md ${PROJECT_SOURCE_DIR}/LICENSE
  DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/leadline-vehicle COMPONENT vehicle)

# The example; what the service writes is where it may (the rest of the file system is read-only to it).
set_property(DIRECTORY APPEND PROPERTY
  CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/firmware/vehicle.example.toml)
file(READ ${PROJECT_SOURCE_DIR}/firmware/vehicle.example.toml vehicle_toml)
set(packaged_toml "${vehicle_toml}")
foreach(written "path = \"survey.lll\"" "path = \"map.llp\"" "counter = \"command.key.taken\"")
  string(FIND "${packaged_toml}" "${written}" at)
  if(at EQUAL -1)
    message(FATAL_ERROR "firmware/vehicle.example.toml has no ${written} any more")
  endif()
  string(REPLACE " = \"" " = \"/var/lib/leadline/" packaged "${written}")
  string(REPLACE "${written}" "${packaged}" packaged_toml "${packaged_toml}")
endforeach()
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/packaging/vehicle.toml CONTENT "${packaged_toml}" @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/packaging/vehicle.toml
  DESTINATION /etc/leadline COMPONENT vehicle)

if(TARGET leadline)
  install(TARGETS leadline RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT topside)
  install(FILES ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/LICENSE
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/leadline COMPONENT topside)
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "Leadline <leadline@localhost>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_OUTPUT_FILE_PREFIX ${PROJECT_BINARY_DIR}/packages)
set(CPACK_COMPONENTS_ALL vehicle)
if(TARGET leadline)
  list(APPEND CPACK_COMPONENTS_ALL topside)
endif()
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
if(CMAKE_CROSSCOMPILING)
  set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE ${leadline_debian_architecture})
endif()
set(CPACK_DEBIAN_VEHICLE_PACKAGE_NAME leadline-vehicle)
set(CPACK_DEBIAN_VEHICLE_PACKAGE_SECTION science)
set(CPACK_COMPONENT_VEHICLE_DESCRIPTION
  "Embedded fixed-point 3-D sonar modeler, the vehicle's side
 Maps the seafloor while the vehicle dives: sonar and navigation in, depth-map
 deltas out. With a service, stable names of serial lines, and the commented
 configuration /etc/leadline/vehicle.toml.")
# By hand, the same for every architecture: dpkg-shlibdeps knows installed packages only. cli.package_ci compares them with
# what the programs name, toolchain/package.sh --try runs the programs with these and nothing else.
set(CPACK_DEBIAN_VEHICLE_PACKAGE_DEPENDS
  "libc6 (>= 2.36), libgcc-s1, libgpiod2, libmodbus5, libsodium23, libstdc++6 (>= 12), libsystemd0, adduser")
set(CPACK_DEBIAN_VEHICLE_PACKAGE_CONTROL_EXTRA
  "${packaging}/postinst;${packaging}/prerm;${packaging}/postrm;${packaging}/conffiles")
set(CPACK_DEBIAN_TOPSIDE_PACKAGE_NAME leadline)
set(CPACK_DEBIAN_TOPSIDE_PACKAGE_SECTION science)
set(CPACK_COMPONENT_TOPSIDE_DESCRIPTION
  "Embedded fixed-point 3-D sonar modeler, the surface's side
 Receives, draws and exports the map that a vehicle makes, replays its logs,
 imports recordings, emulates devices.")
set(CPACK_DEBIAN_TOPSIDE_PACKAGE_DEPENDS
  "libc6 (>= 2.36), libcairo2, libgcc-s1, libgdal32, libgpiod2, libmodbus5, libsodium23, libsqlite3-0, libstdc++6 (>= 12)")
include(CPack)

"""ISE for Conan 2: `conan create cmake/conan`, in a checkout of ISE."""

import os
import re

from conan import ConanFile
from conan.errors import ConanInvalidConfiguration
from conan.tools.build import check_min_cppstd
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load

required_conan_version = ">=2.0"
# The sources of the library, without tests and without the boat.
SOURCES = ("CMakeLists.txt", "LICENSE", "cmake/*", "docs/CMakeLists.txt", "docs/Doxyfile.in", "ise/*", "tests/lint/*.py")


class IseConan(ConanFile):
    name = "ise"
    description = "Coroutine middleware for robots: components that talk through typed services, on standalone Asio"
    license = "Apache-2.0"
    topics = ("robotics", "middleware", "coroutines", "asio")
    package_type = "static-library"
    settings = "os", "arch", "compiler", "build_type"
    options = {"with_openssl": [True, False]}
    default_options = {"with_openssl": True}

    def set_version(self):
        if not self.version:
            lists = load(self, os.path.join(self._checkout, "CMakeLists.txt"))
            self.version = re.search(r"project\(ise VERSION ([0-9.]+)", lists)[1]

    @property
    def _checkout(self):
        return os.path.normpath(os.path.join(self.recipe_folder, "..", ".."))

    def export_sources(self):
        for pattern in SOURCES:
            copy(self, pattern, self._checkout, self.export_sources_folder)

    def layout(self):
        cmake_layout(self)

    def requirements(self):
        # Asio is compiled into the library, and the headers include all three.
        self.requires("asio/1.30.2", transitive_headers=True)
        self.requires("cereal/1.3.2", transitive_headers=True)
        self.requires("fmt/10.2.1", transitive_headers=True)
        self.requires("nlohmann_json/3.11.3", visible=False)
        if self.options.with_openssl:
            self.requires("openssl/[>=3.0 <4]")

    def validate(self):
        check_min_cppstd(self, 20)
        if self.settings.os != "Linux":
            raise ConanInvalidConfiguration("ISE runs on Linux only")

    def generate(self):
        CMakeDeps(self).generate()
        toolchain = CMakeToolchain(self)
        toolchain.cache_variables["ISE_WITH_OPENSSL"] = bool(self.options.with_openssl)
        for off in ("ISE_BUILD_APPS", "ISE_BUILD_BENCH", "ISE_BUILD_TESTS"):
            toolchain.cache_variables[off] = False
        # Asio has no CMake package of its own, and ISE's finder is to find it.
        if "asio" in self.dependencies and self.dependencies["asio"].package_folder:
            toolchain.cache_variables["Asio_ROOT"] = self.dependencies["asio"].package_folder.replace("\\", "/")
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build(target="ise")

    def package(self):
        CMake(self).install()

    def package_info(self):
        # The package's own files: they know the definitions that users must share, and refuse another compiler.
        self.cpp_info.set_property("cmake_find_mode", "none")
        self.cpp_info.builddirs = [os.path.join("lib", "cmake", "ise")]
        self.cpp_info.libs = ["ise"]
        self.cpp_info.system_libs = ["pthread"]

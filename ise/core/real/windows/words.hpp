#pragma once
// Included before every file that is compiled with ISE on Windows (ise/CMakeLists.txt): the headers of Windows, which
// Asio includes, define these two as macros of nothing.
#include <winsock2.h>

#include <windows.h>

#undef far
#undef near

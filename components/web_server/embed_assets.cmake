# Run at build time: cmake -DOUTPUT=assets_data.cpp -DWORK=folder -DLIST=files.txt -P embed_assets.cmake
# LIST has one "path|content type|file" a line. g++ 12 has no #embed, so the bytes come in by .incbin.
cmake_policy(VERSION 3.25)
find_program(GZIP gzip PATHS /usr/bin /bin)
file(STRINGS "${LIST}" lines)
set(data "")
set(declarations "")
set(table "")
set(count 0)
file(MAKE_DIRECTORY "${WORK}")
foreach(line IN LISTS lines)
  # Content types hold semicolons, so the line is no list.
  string(REGEX MATCH "^([^|]*)[|]([^|]*)[|](.*)$" matched "${line}")
  set(path "${CMAKE_MATCH_1}")
  set(type "${CMAKE_MATCH_2}")
  set(file "${CMAKE_MATCH_3}")
  file(SHA256 "${file}" hash)
  string(SUBSTRING "${hash}" 0 16 tag)
  file(SIZE "${file}" size)
  string(APPEND data "    \"atirma_asset_${count}: .incbin \\\"${file}\\\"\\n\"\n    \"atirma_asset_${count}_end: .byte 0\\n\"\n")
  string(APPEND declarations "extern const char atirma_asset_${count}[], atirma_asset_${count}_end[];\n")
  set(gzip_view "{}")
  if(GZIP)
    set(packed "${WORK}/${count}.gz")
    execute_process(COMMAND "${GZIP}" -9 -n -c "${file}" OUTPUT_FILE "${packed}" RESULT_VARIABLE failed)
    file(SIZE "${packed}" packed_size)
    if(NOT failed AND packed_size LESS size)
      string(APPEND data "    \"atirma_asset_${count}_gz: .incbin \\\"${packed}\\\"\\n\"\n    \"atirma_asset_${count}_gz_end: .byte 0\\n\"\n")
      string(APPEND declarations "extern const char atirma_asset_${count}_gz[], atirma_asset_${count}_gz_end[];\n")
      set(gzip_view "view(atirma_asset_${count}_gz, atirma_asset_${count}_gz_end)")
    endif()
  endif()
  string(APPEND table "        {\"${path}\", \"${type}\", view(atirma_asset_${count}, atirma_asset_${count}_end), ${gzip_view}, \"\\\"${tag}\\\"\"},\n")
  math(EXPR count "${count} + 1")
endforeach()
file(WRITE "${OUTPUT}" "// Made by embed_assets.cmake.
#include <components/web_server/assets.hpp>

#include <array>

__asm__(
    \".pushsection .rodata\\n\"
${data}    \".popsection\\n\");

extern \"C\" {
${declarations}}

namespace atirma {

namespace {
std::string_view view(const char* begin, const char* end) { return {begin, static_cast<std::size_t>(end - begin)}; }
} // namespace

std::span<const ise::static_file> page_assets() noexcept {
    static const std::array<ise::static_file, ${count}> table = {{
${table}    }};
    return table;
}

} // namespace atirma
")

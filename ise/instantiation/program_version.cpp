// environment-boundary: what an instantiation server does to its host is done here
#include <ise/instantiation/process_table.hpp>
#include <ise/instantiation/real_machine.hpp>

#include <fmt/format.h>

#include <cstring>
#include <vector>

#include <elf.h>
#include <fcntl.h>
#include <link.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ise::instantiation {
namespace {

constexpr std::size_t max_headers = 256;
constexpr std::size_t max_note_bytes = 64 << 10;

template <class T>
bool read_at(int from, std::uint64_t offset, T* into, std::size_t count) {
    auto bytes = static_cast<ssize_t>(count * sizeof(T));
    return ::pread(from, into, static_cast<std::size_t>(bytes), static_cast<off_t>(offset)) == bytes;
}

// The one among the notes of a segment; empty: it has none.
std::string build_id_in(const std::vector<unsigned char>& notes) {
    ElfW(Nhdr) head{};
    auto whole = [](std::size_t size) { return (size + 3) & ~std::size_t{3}; };
    for (std::size_t at = 0; at + sizeof head <= notes.size();) {
        std::memcpy(&head, notes.data() + at, sizeof head);
        auto name = at + sizeof head, content = name + whole(head.n_namesz), next = content + whole(head.n_descsz);
        if (next > notes.size()) break;
        bool is_it =
            head.n_type == NT_GNU_BUILD_ID && head.n_namesz == 4 && std::memcmp(notes.data() + name, "GNU", 4) == 0;
        std::string id;
        for (std::size_t byte = content; is_it && byte < content + head.n_descsz; ++byte)
            id += fmt::format("{:02x}", notes[byte]);
        if (is_it) return id;
        at = next;
    }
    return {};
}

std::string build_id_of(int file) {
    ElfW(Ehdr) head{};
    if (!read_at(file, 0, &head, 1) || std::memcmp(head.e_ident, ELFMAG, SELFMAG) != 0 ||
        head.e_phentsize != sizeof(ElfW(Phdr)) || head.e_phnum > max_headers)
        return {};
    std::vector<ElfW(Phdr)> segments(head.e_phnum);
    if (!read_at(file, head.e_phoff, segments.data(), segments.size())) return {};
    for (const auto& one : segments) {
        if (one.p_type != PT_NOTE || one.p_filesz > max_note_bytes) continue;
        std::vector<unsigned char> notes(one.p_filesz);
        if (!read_at(file, one.p_offset, notes.data(), notes.size())) continue;
        auto id = build_id_in(notes);
        if (!id.empty()) return id;
    }
    return {};
}

} // namespace

std::string real_machine::version_of(const std::string& program) const {
    file_handle file(::open(program.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
    struct stat about {};
    // One may be run that may not be read.
    bool there = file ? ::fstat(file.get(), &about) == 0 : ::stat(program.c_str(), &about) == 0;
    if (!there || !S_ISREG(about.st_mode)) return {};
    auto id = file ? build_id_of(file.get()) : std::string();
    if (!id.empty()) return "build " + id;
    return fmt::format("{} bytes of {}.{:09}", about.st_size, about.st_mtim.tv_sec, about.st_mtim.tv_nsec);
}

} // namespace ise::instantiation

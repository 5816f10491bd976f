#pragma once
#include <ise/instantiation/kept_status.hpp>
#include <ise/instantiation/machine.hpp>
#include <ise/instantiation/services.hpp>

#include <optional>
#include <string>

namespace ise::instantiation {

/// What an instance has printed, as its keeper wrote it (keeper.hpp): a file and an older one, both bounded. They
/// outlive everybody.
class output_file {
public:
    output_file(machine& host, std::string file, std::uint64_t max_bytes);

    const std::string& file() const noexcept { return file_; }
    std::uint64_t max_bytes() const noexcept { return max_bytes_; }
    /// Gives what has come since the last time (as much as is given at once) if somebody wants it. `offset` jumps over
    /// what could not be kept.
    output_piece look(bool wanted);
    /// The end of it, from the start of a line on, at most so many bytes.
    output_piece last(std::size_t max_bytes) const;
    /// Its last lines, for a message.
    std::string last_lines(std::size_t lines) const;
    /// What its keeper recorded; nothing where there is no record.
    std::optional<kept_status> status() const;
    /// Bytes that were dropped so far, and why if they still are, when `look` was called last.
    std::uint64_t dropped() const noexcept { return dropped_; }
    const std::string& trouble() const noexcept { return trouble_; }
    void remove();

private:
    struct range {
        std::uint64_t from = 0; ///< of the bytes that were printed: those before are not in the file
        std::string text;
    };
    std::uint64_t end() const;
    range read(std::uint64_t from, std::size_t most) const;

    machine& host_;
    std::string file_;
    std::uint64_t max_bytes_;
    std::uint64_t seen_ = 0; // of all that was printed
    std::uint64_t dropped_ = 0;
    std::string trouble_;
};

} // namespace ise::instantiation

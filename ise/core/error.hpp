#pragma once
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

namespace ise {

/// The kind of an error, to branch on; docs/errors.md has the remedies. The message of the error has the details.
/// The numbers are part of the wire format (FORMAT.md): they are never reused.
enum class errc : std::uint8_t {
    refused = 1,           ///< the provider refused the request; the message is its reason
    no_such_service = 2,   ///< the component provides no service of that name and kind
    type_mismatch = 3,     ///< the packets of the two sides differ incompatibly; the message is the diff
    timed_out = 4,         ///< the deadline passed
    peer_lost = 5,         ///< the session ended before the answer
    cancelled = 6,         ///< the caller cancelled, or a component stopped
    overloaded = 7,        ///< a bounded queue or table is full
    handler_failed = 8,    ///< the handler threw; the message is its text
    malformed = 9,         ///< bytes or JSON that do not match the packet
    too_large = 10,        ///< a limit was exceeded; the message names it
    protocol_error = 11,   ///< the peer violated the wire format
    version_mismatch = 12, ///< no common version of the wire format
    wrong_peer = 13,       ///< the endpoint belongs to another component, epoch or incarnation
    unreachable = 14,      ///< no session could be made
    no_such_name = 15,     ///< nothing is registered under that path
    name_taken = 16,       ///< the path is held by another component
    name_server_lost = 17, ///< the name server does not answer
    superseded = 18,       ///< a component with a higher epoch holds the path now
    address_in_use = 19,   ///< the endpoint to listen on is taken
    invalid_argument = 20, ///< an invalid argument or state of the program
    would_block_self = 21, ///< a blocking wait on the component's own thread
    io_failed = 22,        ///< the operating system reported an error, which is in the message
    unauthorized = 23,     ///< credentials missing or not accepted
    not_connected = 24,    ///< a component's handler has no connection right now; ISE itself does not use it
    access_denied = 25,    ///< the access policy does not allow it to this identity
};

/// The category of `std::error_code`s made from `errc`: "ise".
const std::error_category& error_category() noexcept;
/// Converts an errc to a `std::error_code`.
std::error_code make_error_code(errc code) noexcept;

/// The name of a code as users write it: "timed_out".
std::string_view name_of(errc code) noexcept;

/// Whether a call that failed may have run at the provider.
enum class execution : std::uint8_t {
    not_executed = 0, ///< certainly not executed: the call may be repeated
    unknown = 1,      ///< it may have run, or may still run
};

/// "not_executed", "unknown".
std::string_view name_of(execution state) noexcept;

/// An expected failure, as a value.
class failure {
public:
    /// `message` says what happened, to what, why, and what to do.
    [[gnu::cold]] failure(errc code, std::string message, execution state = execution::not_executed);

    /// The code, to branch on.
    errc code() const noexcept { return code_; }
    /// For a call: whether it may have run.
    execution executed() const noexcept { return execution_; }
    /// The message, for people.
    const std::string& message() const noexcept { return message_; }

private:
    std::string message_;
    errc code_;
    execution execution_;
};

/// An expected failure, as an exception: what the plain (not `try_`) forms throw.
class error : public std::runtime_error {
public:
    /// `what()` is the message of the failure.
    explicit error(failure why) : std::runtime_error(why.message()), failure_(std::move(why)) {}
    /// Thrown from a handler, errc::refused and errc::access_denied reach the caller unchanged; any other code becomes
    /// errc::handler_failed with its text.
    error(errc code, std::string message, execution state = execution::not_executed)
        : error(failure(code, std::move(message), state)) {}

    /// The code, to branch on.
    errc code() const noexcept { return failure_.code(); }
    /// For a call: whether it may have run.
    execution executed() const noexcept { return failure_.executed(); }
    /// The failure as a value.
    const failure& why() const noexcept { return failure_; }

private:
    failure failure_;
};

/// A failure of the operating system with the operation: "cannot listen on tcp://…: Address already in use".
failure io_failure(std::string_view what, const std::error_code& cause);

} // namespace ise

template <>
struct std::is_error_code_enum<ise::errc> : std::true_type {};

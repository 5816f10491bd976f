#pragma once
#include <components/foxglove_gateway/gateway_options.hpp>
#include <components/foxglove_gateway/services.hpp>

#include <ise/bag/protobuf.hpp>
#include <ise/component/component.hpp>
#include <ise/component/introspection.hpp>
#include <ise/core/log_limiter.hpp>

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace ise::foxglove {

inline constexpr std::size_t max_channels = 16384;
inline constexpr std::size_t max_message_bytes = std::size_t{32} << 20; ///< that is made of a packet
inline constexpr std::size_t max_packet_bytes = std::size_t{16} << 20;  ///< that is made of a viewer's message

/// The same for protobuf.
inline bag::protobuf_limits message_limits() {
    bag::protobuf_limits made;
    made.max_message_bytes = max_message_bytes;
    made.max_packet_bytes = max_packet_bytes;
    return made;
}

/// A component as it was described.
struct known_component {
    std::map<std::string, std::string> services; ///< those that are shown: name, and what identifies its types
    std::optional<component_info> about;
    bool has_parameters = false;
};

/// What the parts of a gateway share: its component, its options, its counts and the components that it knows. `of` and
/// `how` must outlive it. Used on the component's loop.
class gateway_context {
public:
    gateway_context(component& of, const gateway_options& how) : self(of), options(how) {}

    component& self;
    const gateway_options& options;
    gateway_status counts;
    std::map<std::string, known_component> components; ///< by path

    /// Logs a warning; of many only some, with the number of those left out.
    void note(const std::string& what);
    /// The number of a channel or a service, which it keeps when it comes again.
    std::uint32_t number_of(const std::string& what);
    /// A number that nothing has had.
    std::uint32_t fresh_number() noexcept { return ++last_number_; }

private:
    std::map<std::string, std::uint32_t> numbers_; // by what they are of
    std::uint32_t last_number_ = 0;
    log_limiter quiet_;
};

/// A key that is different for different schemas.
std::string identity_of(const schema_info& of);

} // namespace ise::foxglove

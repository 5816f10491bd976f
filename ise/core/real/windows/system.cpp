#include <ise/core/real/system.hpp>

#include <asio/detail/socket_types.hpp> // Winsock, before windows.h
#include <asio/ip/address.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <system_error>

#include <windows.h>

#include <bcrypt.h>
#include <iphlpapi.h>
#include <pthread.h>

namespace ise::real {
namespace {

// Made when Windows was installed.
std::string machine_id() {
    std::array<char, 64> text{};
    DWORD size = text.size() - 1;
    if (::RegGetValueA(HKEY_LOCAL_MACHINE, "SOFTWARE\\Microsoft\\Cryptography", "MachineGuid",
                       RRF_RT_REG_SZ | RRF_SUBKEY_WOW6464KEY, nullptr, text.data(), &size) != ERROR_SUCCESS)
        return {};
    return text.data();
}

} // namespace

void draw_random(std::span<std::uint64_t> into) {
    if (::BCryptGenRandom(nullptr, reinterpret_cast<PUCHAR>(into.data()), static_cast<ULONG>(into.size_bytes()),
                          BCRYPT_USE_SYSTEM_PREFERRED_RNG) != 0)
        throw std::system_error(std::make_error_code(std::errc::io_error), "Windows draws no random numbers");
}

process_identity this_process() {
    process_identity made;
    std::array<char, 256> name{};
    auto size = static_cast<DWORD>(name.size() - 1);
    ::GetComputerNameExA(ComputerNameDnsHostname, name.data(), &size);
    made.host_name = name.data();
    made.host_key = fmt::format("windows.{}.{}", made.host_name, machine_id());
    made.process_id = ::GetCurrentProcessId();
    std::uint64_t life = 0;
    draw_random({&life, 1});
    made.process_key = fmt::format("{}.{:016x}", made.process_id, life);
    return made;
}

time_point recent_time() {
    return time_point(std::chrono::duration_cast<duration>(std::chrono::steady_clock::now().time_since_epoch()));
}

std::vector<std::string> interface_addresses() {
    std::vector<std::string> found;
    constexpr ULONG flags = GAA_FLAG_SKIP_ANYCAST | GAA_FLAG_SKIP_MULTICAST | GAA_FLAG_SKIP_DNS_SERVER;
    ULONG size = 32'768;
    std::vector<std::byte> room;
    ULONG outcome = ERROR_BUFFER_OVERFLOW;
    for (int attempt = 0; attempt < 3 && outcome == ERROR_BUFFER_OVERFLOW; ++attempt) {
        room.resize(size);
        outcome = ::GetAdaptersAddresses(AF_UNSPEC, flags, nullptr,
                                         reinterpret_cast<IP_ADAPTER_ADDRESSES*>(room.data()), &size);
    }
    if (outcome != ERROR_SUCCESS) return found;
    for (auto* each = reinterpret_cast<IP_ADAPTER_ADDRESSES*>(room.data()); each; each = each->Next) {
        if (each->OperStatus != IfOperStatusUp) continue;
        for (auto* one = each->FirstUnicastAddress; one; one = one->Next) {
            const auto* address = one->Address.lpSockaddr;
            if (address->sa_family == AF_INET) {
                const auto* v4 = reinterpret_cast<const sockaddr_in*>(address);
                found.push_back(asio::ip::address_v4(ntohl(v4->sin_addr.s_addr)).to_string());
            } else if (address->sa_family == AF_INET6) {
                asio::ip::address_v6::bytes_type bytes;
                const auto* v6 = reinterpret_cast<const sockaddr_in6*>(address);
                std::copy_n(v6->sin6_addr.s6_addr, bytes.size(), bytes.begin());
                auto text = asio::ip::address_v6(bytes);
                if (!text.is_link_local()) found.push_back(text.to_string()); // useless without a scope
            }
        }
    }
    return found;
}

void name_thread(std::thread& thread, const std::string& name) {
    ::pthread_setname_np(thread.native_handle(), name.c_str());
}

} // namespace ise::real

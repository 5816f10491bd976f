#pragma once

namespace ise {

class loop;

/// Something that waits on a loop, as the loop sees it: enough to let go of it when the loop ends.
class suspended {
public:
    suspended(const suspended&) = delete;
    suspended& operator=(const suspended&) = delete;

protected:
    suspended() = default;
    ~suspended() = default;

private:
    friend class loop;
    /// Destroys what waits without resuming it. May destroy *this.
    virtual void drop() noexcept = 0;

    suspended* previous_ = nullptr;
    suspended* next_ = nullptr;
};

} // namespace ise

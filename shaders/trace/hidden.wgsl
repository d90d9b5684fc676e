// Which triangles are there for no ray. Where none is hidden, kernels have a function in place of this file that says
// no.

// Global ids, ascending, at which hiding begins and ends in turns.
@group(0) @binding(10) var<storage, read> hidden: array<u32>;

fn is_hidden(id: u32) -> bool {
    // How many are not above `id`: where that is odd, hiding has begun and not ended.
    var first = 0u;
    var end = arrayLength(&hidden);
    while first < end {
        let middle = (first + end) / 2u;
        if hidden[middle] <= id {
            first = middle + 1u;
        } else {
            end = middle;
        }
    }
    return (first & 1u) == 1u;
}
